#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh test`: lint, unit tests, most of them under a comma-decimal locale, rostests.

At the end it prints the tests that did not run, with reasons, those that failed, and one line of counts.

With --busy[=PERCENT] everything gets that share of one core, and without names the suites of the main flows run.
"""

import argparse
import concurrent.futures
import contextlib
import functools
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from lab_tests import comma_locale, rostests
from lab_tests.discovery import SelectionError, select, take_inventory
from lab_tests.quota import Quota, QuotaError
from lab_tests.results import Tally, failure, read_junit, summary

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / ".baxter" / "tests"
LINT_COMMANDS = {
    "ruff": [sys.executable, "-m", "ruff", "check", "--quiet", str(ROOT)],
    # Offline: with rosdep's database the result would depend on an earlier `rosdep update`.
    "catkin_lint": ["catkin_lint", "--offline", "--strict", "--quiet", "-W1", str(ROOT / "src")],
}
PYTEST_NO_TESTS_COLLECTED = 5
# The tests of --busy without names, one for each main flow: they must also pass on a fifth of a two-core machine.
MAIN_FLOWS = (
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
# Rostests that run at a time beside another one on a whole machine. They mostly wait, and do not fill a core each.
BESIDE = 2


def run_linter(name: str) -> Tally:
    done = subprocess.run(LINT_COMMANDS[name], capture_output=True, text=True, cwd=ROOT)
    if done.returncode == 0:
        return Tally(passed=1)
    return failure(f"{name}:\n{done.stdout}{done.stderr}".rstrip())


class UnitRun:
    """One pytest process, which starts at once; its output goes to the terminal, or into a file."""

    def __init__(self, title: str, targets, arguments, environment=None, output: Path | None = None,
                 leaves_out_long: bool = False):
        self._title, self._output = title, output
        self._report, self._left_out = WORK / f"{title}.xml", WORK / f"{title}-left-out.txt"
        self._report.unlink(missing_ok=True)
        self._left_out.unlink(missing_ok=True)
        options = ["-q", "-p", "lab_tests.long_tests", "-p", "lab_tests.left_threads",
                   "--continue-on-collection-errors", f"--junitxml={self._report}", *arguments]
        if leaves_out_long:
            options.append(f"--leave-out-long={self._left_out}")
        environment = {**(environment or os.environ)}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT / "tools"), environment.get("PYTHONPATH")]))
        command = [sys.executable, "-m", "pytest", *options, *targets]
        with contextlib.nullcontext() if output is None else output.open("wb") as stream:
            self._child = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=stream, stderr=stream)

    def tally(self) -> Tally:
        """Wait for its end and count."""
        code = self._child.wait()
        long = self._left_out.read_text(encoding="utf-8").splitlines() if self._left_out.is_file() else []
        if code == PYTEST_NO_TESTS_COLLECTED:
            return Tally(long=long)
        if not self._report.is_file():
            said = self._output.read_text(errors="replace") if self._output else ""
            died = f"{self._title}: pytest died with exit code {code} before it wrote its report"
            return failure(f"{died}\n{said}".rstrip())
        tally = read_junit(self._report)
        tally.long = long
        tally.is_told = self._output is None
        if code != 0 and tally.failed == 0:
            tally.add(failure(f"{self._title}: pytest ended with exit code {code}"))
        return tally

    def kill(self):
        self._child.kill()
        self._child.wait()


class FailedStart:
    """Replaces a UnitRun that could not start."""

    def __init__(self, detail: str):
        self._detail = detail

    def tally(self) -> Tally:
        return failure(self._detail)

    def kill(self):
        """Nothing to stop."""


def start_unit_under_comma_locale(targets):
    try:
        environment = comma_locale.environment(WORK.parent / "locale")
    except (OSError, subprocess.CalledProcessError) as error:
        detail = getattr(error, "stderr", None) or ""
        return FailedStart(f"cannot make the locale {comma_locale.NAME}: {error}\n{detail}")
    # Long tests and builds do not depend on decimal points. Two pytests must not share a cache.
    arguments = ["-p", "lab_tests.comma_locale", "-p", "no:cacheprovider", "-m", "not long and not build and not once"]
    return UnitRun("unit-comma-locale", targets, arguments, environment, WORK / "unit-comma-locale.txt")


def layers(selection, long: bool, stretch: float, ending: contextlib.ExitStack):
    """(title, function that runs it) of everything chosen, fastest first. Objects in `ending` are ended with the
    tests."""
    for name in selection.linters:
        yield name, functools.partial(run_linter, name)
    if selection.unit_targets:
        # A test that is named runs even if it is long; the user's own -m comes later and takes precedence.
        is_single = any("::" in target for target in selection.unit_targets)
        elsewhere = []
        if selection.is_whole_suite:
            # With --long most tests run twice. Otherwise those that the second locale's run has run there alone: what
            # passes there passes under the usual locale, too.
            elsewhere = ["--in-the-other-run=tree" if long else "--in-this-run=once,build"]
        runs = {"unit tests": UnitRun("unit", selection.unit_targets, elsewhere + selection.pytest_arguments,
                                      leaves_out_long=not (long or is_single))}
        ending.callback(runs["unit tests"].kill)
        if selection.is_whole_suite:
            # At the same time: each keeps one core busy.
            again = start_unit_under_comma_locale(selection.unit_targets)
            ending.callback(again.kill)
            runs[f"unit tests under {comma_locale.NAME}, meanwhile"] = again
        for title, run in runs.items():
            yield title, run.tally
    alone = [test for test in selection.rostests if not test.is_beside_others]
    beside = Beside([test for test in selection.rostests if test.is_beside_others], stretch)
    ending.callback(beside.end)
    for test in alone:
        yield title_of(test), functools.partial(rostests.run, test, folder_of(test), stretch=stretch)
    for test in beside.tests:
        yield f"{title_of(test)}, meanwhile", functools.partial(beside.tally, test)


def title_of(test: rostests.Rostest) -> str:
    return f"{test.package} {test.path.name}"


def folder_of(test: rostests.Rostest) -> Path:
    return WORK / f"{test.package}-{test.path.stem}"


class Beside:
    """Runs rostests that leave processor time to others, some at a time, while others run.

    tests: in the order in which they begin: those with the longest limits first, because a long one that begins last
    would run alone.
    """

    def __init__(self, tests, stretch: float = STRETCH):
        self.tests = sorted(tests, key=lambda test: rostests.declared_s(test.path), reverse=True)
        self._stretch = stretch
        self._ending = threading.Event()
        self._executor = concurrent.futures.ThreadPoolExecutor(max_workers=BESIDE if stretch == STRETCH else 1)
        self._tallies = {test: self._executor.submit(self._run, test) for test in self.tests}

    def _run(self, test):
        if self._ending.is_set():
            raise rostests.Ended
        return rostests.run(test, folder_of(test), ending=self._ending, stretch=self._stretch)

    def tally(self, test) -> Tally:
        """Wait for its end."""
        return self._tallies[test].result()

    def end(self):
        """Stop the running test, and start no more."""
        self._ending.set()
        self._executor.shutdown(cancel_futures=True)


def run_layers(selection, long: bool, stretch: float = STRETCH) -> Tally:
    """Run all selected tests and print each result."""
    os.environ[rostests.STRETCH_VARIABLE] = f"{stretch:g}"
    total = Tally(long=[name for test in selection.left_out for name in rostests.names(test, ROOT)])
    with contextlib.ExitStack() as ending:
        for title, run in layers(selection, long, stretch, ending):
            print(f"=== {title}", flush=True)
            started = time.monotonic()
            tally = run()
            tally.refuse_bare_skips()
            if not tally.is_told:
                print(*tally.details, sep="\n", end="\n" if tally.details else "")
            verdict = "FAILED" if tally.failed else "ok" if tally.passed else "nothing to run"
            counts = f"{tally.passed} passed, {tally.failed} failed, {tally.skipped} skipped"
            print(f"--- {title}: {verdict} ({counts}; {time.monotonic() - started:.1f} s)", flush=True)
            total.add(tally)
    return total


def run_with_share(selection, options) -> Tally:
    """Run all selected tests, with --busy on a share of one core. Raises ValueError, QuotaError."""
    if options.busy is None:
        return run_layers(selection, options.long)
    with Quota(options.busy):
        print(f"--busy: {options.busy:g} % of one core", flush=True)
        return run_layers(selection, options.long, STRETCH * max(1.0, WHOLE_MACHINE_PERCENT / options.busy))


def separate_busy(words: list[str]) -> list[str]:
    """`--busy NAME` means the default share and a test's name; NAME is not the share."""
    return [f"--busy={BUSY_PERCENT:g}" if word == "--busy" else word for word in words]


def main() -> int:
    parser = argparse.ArgumentParser(prog="./baxter.sh test", allow_abbrev=False, add_help=False)
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--busy", type=float, metavar="PERCENT")
    options, arguments = parser.parse_known_args(separate_busy(sys.argv[1:]))
    WORK.mkdir(parents=True, exist_ok=True)
    # In a script's background job Ctrl-C is ignored, also by every child; but tests send it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        names = arguments or list(() if options.busy is None else MAIN_FLOWS)
        selection = select(take_inventory(ROOT), names, options.long)
    except SelectionError as error:
        print(error, file=sys.stderr)
        return 2

    try:
        total = run_with_share(selection, options)
    except ValueError as error:
        print(f"--busy: {error}", file=sys.stderr)
        return 2
    except QuotaError as error:
        print(f"--busy: skipped. A share of a core needs root, or control groups that users may make: {error}")
        print(summary(Tally()))
        return EXIT_SKIPPED
    if total.passed + total.failed == 0:
        print("No test ran.")
    print(summary(total), flush=True)
    return 0 if total.passed and not total.failed else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
