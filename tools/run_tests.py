#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh test`: lint, unit tests and rostests, all by pytest.

At the end it prints the tests that did not run, with reasons, those that failed, and one line of counts.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import sys
import uuid
from itertools import zip_longest
from pathlib import Path

import pytest

from lab_tests import processes
from lab_tests.discovery import (
    WORKERS_BESIDE_CORES,
    Selection,
    SelectionError,
    changed_files,
    names_and_options,
    select,
    take_inventory,
)
from lab_tests.quota import ProcessorQuota, QuotaError
from lab_tests.results import Tally, summary

ROOT = Path(__file__).resolve().parent.parent
# The tests of --busy without names, one for each main flow: they must also pass on a fifth of a two-core machine.
MAIN_FLOWS: tuple[str, ...] = (
    "enable_robot.test",
    "tools_world.test",  # enabling and moving in the simulator
    "lab2_nodes.test",  # Glasgow's lab: move_baxter and its other nodes
    "position_kinematics.test",
    "trajectory_server.test",
    "trajectory_controller.test",
    "cwru_world.test",
    "traj_streamer_world.test",  # Case Western's lab
    "probot_anno_bringup.test",
    "probot_anno.test",  # ros_control's lab
    "checks_exercises.test",  # the judge
)
BUSY_PERCENT = 40.0
# The limits are for a machine with two cores.
WHOLE_MACHINE_PERCENT = 200.0
EXIT_SKIPPED = 77
# Factor of all time limits. They are written for an idle machine with two fast cores; others may be half as fast, or
# have neighbours. Only a test that hangs takes longer by it.
STRETCH = 2.0
# Fewer files run in this process itself, which is quicker, and lets pytest's --pdb work.
MIN_FILES_FOR_WORKERS = 3
USAGE = "./baxter.sh test [NAME…] [OPTION…] [pytest's options]"
EXAMPLES = """\
A NAME is a package, a folder (src/baxter), a test file (test_x.py, x.test), a test (test_x.py::test_one), ruff or
catkin_lint. Examples:
  ./baxter.sh test                        everything but what takes minutes; what continuous integration runs
  ./baxter.sh test --changed              what changed since the last commit, and all that depends on it
  ./baxter.sh test --changed main~3       the same since that commit
  ./baxter.sh test bullet_sim             one package
  ./baxter.sh test -k gripper -x --lf     pytest's own options, over everything; ./baxter.sh test --durations=20
  ./baxter.sh test --collect-only -q      the names of all tests; with -m long: of the long ones
  ./baxter.sh test --repeat 3 --shuffle 1 three rounds in three orders
  ./baxter.sh test torture                everything that a lab should survive, about an hour
"""


def count(text: str) -> int:
    if not re.fullmatch(r"0*[1-9]\d*", text):
        raise argparse.ArgumentTypeError(f"expected a number from 1 on, got {text!r}")
    return int(text)


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(prog="./baxter.sh test", usage=USAGE, epilog=EXAMPLES, allow_abbrev=False,
                                   description="Run tests and count them.",
                                   formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--changed", metavar="REV", nargs="?", const="HEAD",
                      help="the packages that differ from a commit, by default the last one, and all that need them")
    made.add_argument("--long", action="store_true", help="also the tests that take minutes")
    made.add_argument("--busy", metavar="PERCENT", type=float, nargs="?", const=BUSY_PERCENT,
                      help="on that share of one core, by default 40; without names: the main flows")
    made.add_argument("--repeat", metavar="N", type=count, default=1, help="run all of it N times")
    made.add_argument("--shuffle", metavar="SEED", type=int, help="in random order; each round in another one")
    return made


def separate_values(words: list[str]) -> list[str]:
    """`--busy NAME` means the default share and a test's name, and `--changed --long` the last commit."""
    return [f"--busy={BUSY_PERCENT:g}" if word == "--busy" and not re.fullmatch(r"-?\d+(\.\d+)?", after) else word
            for word, after in zip_longest(words, words[1:], fillvalue="")]


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options; ``rest``: names of tests and options of pytest; ``selection``: those that run, where no commit says
    it. Paths count from the workspace, which becomes the current folder."""
    made = parser()
    options, options.rest = made.parse_known_args(separate_values(arguments))
    os.chdir(ROOT)
    try:
        if options.busy is not None and not names_and_options(options.rest)[0] and options.changed is None:
            options.rest += MAIN_FLOWS
        options.selection = select(take_inventory(ROOT), options.rest, ROOT) if options.changed is None else None
    except SelectionError as error:
        made.exit(2, f"{error}\n")
    return options


def pytest_words(selection: Selection, long: bool, stretch: float, workers: int) -> list[str]:
    words = ["-q", "-p", "lab_tests.plugin", f"--rootdir={ROOT}", f"-c{ROOT / 'pytest.ini'}", "--no-header",
             "--continue-on-collection-errors", f"--stretch={stretch:g}"]
    if long:
        words.append("--long")
    if len(selection.targets) >= MIN_FILES_FOR_WORKERS:
        words += [f"-n{workers}", "--dist=loadscope", "--no-loadscope-reorder"]
    return words + selection.pytest_arguments + selection.targets


def run(selection: Selection, options: argparse.Namespace) -> int:
    """All rounds; the exit code. Raises QuotaError."""
    try:
        share = contextlib.nullcontext() if options.busy is None else ProcessorQuota(options.busy)
    except ValueError as error:
        print(f"--busy: {error}", file=sys.stderr)
        return 2
    stretch = STRETCH if options.busy is None else STRETCH * max(1.0, WHOLE_MACHINE_PERCENT / options.busy)
    workers = 1 if options.busy is not None else len(os.sched_getaffinity(0)) + WORKERS_BESIDE_CORES
    words = pytest_words(selection, options.long, stretch, workers)
    with share:
        print(f"Testing {selection.title}{'' if options.busy is None else f', on {options.busy:g} % of one core'}",
              flush=True)
        worst, counted = 0, Tally()
        for number in range(options.repeat):
            order = [] if options.shuffle is None else [f"--shuffle={options.shuffle + number}"]
            if options.repeat > 1:
                print(" ".join([f"Round {number + 1} of {options.repeat}", *order]), flush=True)
            code = int(pytest.main([*order, *words]))
            worst = max(worst, code)
            counted = add_finished(counted)
            if code == pytest.ExitCode.INTERRUPTED:
                break
        if options.repeat > 1:
            print(f"All rounds\n{summary(counted)}", flush=True)
        return worst


def add_finished(counted: Tally) -> Tally:
    """The counts with those of the runs that have ended since the last call; the tests left out are the same ones."""
    from lab_tests.plugin import FINISHED  # pytest has imported it, and would warn if it had been imported before

    while FINISHED:
        counted.add(one := FINISHED.pop())
        counted.long = one.long
    return counted


def main(arguments: list[str]) -> int:
    # In a script's background job Ctrl-C is ignored, also by every child; but tests send it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # A terminal that is closed and a run that is cancelled end it as Ctrl-C does: else its processes would go on.
    for sign in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(sign) == signal.SIG_DFL:
            signal.signal(sign, signal.default_int_handler)
    # Some machines of continuous integration set it. A run starts a thousand Python programs, which would all compile
    # the same modules.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    # Users do not have it either, and it hides what waits for an output that is still in a buffer.
    os.environ.pop("PYTHONUNBUFFERED", None)
    sys.dont_write_bytecode = False
    # Workers import the plugin, tests import the tools.
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT / "tools"), os.environ.get("PYTHONPATH")]))
    options = parse(arguments)
    try:
        selection = options.selection or select(take_inventory(ROOT), options.rest, ROOT,
                                                changed_files(ROOT, options.changed))
    except SelectionError as error:
        print(error, file=sys.stderr)
        return 2
    if not selection.targets:
        print(f"Testing {selection.title}\n{summary(Tally())}")
        return 0
    # All processes that tests start carry it, also those that outlive their test.
    os.environ[processes.RUN_MARKER] = uuid.uuid4().hex
    try:
        return run(selection, options)
    except QuotaError as error:
        print(f"--busy: skipped. A share of a core needs root, or control groups that users may make: {error}")
        print(summary(Tally()))
        return EXIT_SKIPPED
    finally:
        processes.kill_all(os.environ[processes.RUN_MARKER], processes.RUN_MARKER)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
