#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Do the tests find small faults? Puts one at a time into a copy of the workspace, and runs the tests that should find
it.

The copy is an overlay in a separate mount name space, at the workspace's own path: whatever is written there, also by
tests and compilers, is gone afterwards, and other processes see nothing of it.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from faults import FAULTS, ROOT, Fault, FaultError, chosen, read_faults, with_fault

sys.path.insert(0, str(ROOT / "tools"))

from lab_tests import processes  # noqa: E402  (found by the line above)
from lab_tests.discovery import SelectionError, select, take_inventory  # noqa: E402

FOUND, SURVIVED, UNCLEAR, NOT_RUN = "found", "survived", "unclear", "not run"
# Longest run of one fault's tests [s]; one that takes longer counts as found if they do not without the fault.
LIMIT_S = 3600.0
# Time for a run to end its processes [s].
STOP_S = 30.0
EXIT_SKIPPED = 77
MARKER = "LAB_MUTATION_RUN"
# scratch folder, workspace, file with the fault or "", its place, command...
IN_OVERLAY = """
set -e
mount -t tmpfs none "$1"
mkdir "$1/upper" "$1/work"
mount -t overlay none -o "lowerdir=$2,upperdir=$1/upper,workdir=$1/work$OVERLAY_OPTION" "$2"
cd "$2"
if [ -n "$3" ]; then cat "$3" >"$4"; fi
shift 4
exec "$@"
"""
# What tools/run_tests.py prints: the counts, and the failures, each with the test's name first.
COUNTS = re.compile(r"^(\d+) passed, (\d+) failed", re.M)
FIRST_FAILURE = re.compile(r"^failed:\n    (\S.*)(?:\n    (\S.*))?", re.M)


class NoOverlay(Exception):
    """This machine allows no mount name space or no overlay; the text says what it answers."""


@dataclass(frozen=True)
class Result:
    """A row of the results. failing_test: the first one, or why nothing ran."""

    id: str
    kind: str
    by: str
    file: str
    outcome: str
    seconds: float
    failing_test: str


COLUMNS = [one.name for one in fields(Result)]


class Trial:
    """Runs tests in overlays over the workspace `root`; none takes longer than `limit_s` [s]."""

    def __init__(self, root: Path = ROOT, limit_s: float = LIMIT_S) -> None:
        self._root, self._limit_s = root, limit_s

    def check_machine(self) -> None:
        """Raises NoOverlay."""
        try:
            code, output = self._in_overlay(None, ["true"])
        except OSError as error:
            raise NoOverlay(str(error)) from error
        if code != 0:
            raise NoOverlay(output.strip())

    def run(self, fault: Fault) -> Result:
        """Put the fault into a copy, and run its tests to the first failure. A failure counts if the test passes
        without the fault."""
        began = time.monotonic()
        try:
            with_fault(fault, self._root)
        except FaultError as error:
            outcome, failing = NOT_RUN, str(error)
        else:
            outcome, failing = self._run_tests(fault, list(fault.tests))
            if outcome == FOUND and self._fails_without(fault, failing):
                outcome = UNCLEAR
        return Result(fault.id, fault.kind, fault.by, fault.file, outcome, round(time.monotonic() - began, 1), failing)

    def _run_tests(self, fault: Fault | None, names: list[str]) -> tuple[str, str]:
        """(outcome, failing test)"""
        command = [sys.executable, str(self._root / "tools" / "run_tests.py"), *names, "-x"]
        try:
            _, output = self._in_overlay(fault, command)
        except subprocess.TimeoutExpired:
            return FOUND, f"not finished after {self._limit_s:g} s"
        counts = COUNTS.findall(output)
        passed, failed = counts[-1] if counts else ("0", "0")
        if failed == "0":
            last = (output.strip().splitlines() or ["no output"])[-1]
            return (SURVIVED, "") if passed != "0" else (NOT_RUN, last)
        first = FIRST_FAILURE.findall(output)
        name, inner = first[-1] if first else ("", "")
        # Of a .test file, the first line of the text behind it names the test in it.
        return FOUND, f"{name} {inner}" if name.endswith(".test::rostest") else name

    def _fails_without(self, fault: Fault, failing: str) -> bool:
        """Whether the file of the failing test, or else all tests of the fault, fail without it, too."""
        file = failing.partition("::")[0]
        names = [f"{file}::rostest" if file.endswith(".test") else file]
        return self._run_tests(None, names if (self._root / file).is_file() else list(fault.tests))[0] != SURVIVED

    def _in_overlay(self, fault: Fault | None, command: list[str]) -> tuple[int, str]:
        """(exit code, output) of a command at the workspace's path. Raises subprocess.TimeoutExpired."""
        own = os.geteuid() != 0
        with contextlib.ExitStack() as stack:
            scratch = stack.enter_context(tempfile.TemporaryDirectory(prefix="mutation_"))
            changed, place = "", ""
            if fault is not None:
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="mutation_"))
                changed, place = f"{folder}/changed", str(self._root / fault.file)
                Path(changed).write_text(with_fault(fault, self._root), encoding="utf-8")
            output = stack.enter_context(tempfile.TemporaryFile("w+", errors="replace"))
            run_id = uuid.uuid4().hex
            environment = {**os.environ, MARKER: run_id, "OVERLAY_OPTION": ",userxattr" if own else ""}
            space = ["unshare", "--mount", *(["--map-root-user"] if own else []), "--"]
            child = subprocess.Popen(
                [*space, "sh", "-c", IN_OVERLAY, "sh", scratch, str(self._root), changed, place, *command],
                env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                start_new_session=True)
            try:
                code = child.wait(self._limit_s)
            finally:
                _end(child, run_id)
            output.seek(0)
            return code, output.read()


def _end(child: subprocess.Popen, run_id: str) -> None:
    """End a command and all that it started, which keep the overlay alive."""
    if child.poll() is None:
        os.killpg(child.pid, signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(STOP_S)
    processes.kill_all(run_id, MARKER)
    child.wait()


def problems(faults: list[Fault], root: Path = ROOT) -> list[str]:
    """Faults that do not apply any more, and tests that do not exist."""
    found = []
    inventory = take_inventory(root)
    for fault in faults:
        try:
            with_fault(fault, root)
            if not select(inventory, list(fault.tests), root).targets:
                found.append(f"{fault.id}: {', '.join(fault.tests)} has no tests")
        except (FaultError, SelectionError) as error:
            found.append(str(error) if isinstance(error, FaultError) else f"{fault.id}: {error}")
    return found


def results_in(path: Path) -> list[Result]:
    """The rows of an earlier run."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as stream:
        return [Result(**{**row, "seconds": float(row["seconds"])}) for row in csv.DictReader(stream)]


def append(path: Path, result: Result) -> None:
    is_new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        if is_new:
            writer.writerow(COLUMNS)
        writer.writerow(astuple(result))


def table(results: list[Result]) -> str:
    """Row by row, and counted."""
    rows = [f"{one.outcome:8} {one.seconds:7.1f} s  {one.id:28} {one.kind:20} {one.by:11} {one.failing_test}"
            for one in results]
    by = [f"{name}: {sum(one.outcome == FOUND for one in some)} of {len(some)}"
          for name in dict.fromkeys(one.by for one in results) if (some := [one for one in results if one.by == name])]
    counts = ", ".join(f"{sum(one.outcome == name for one in results)} {name}"
                       for name in (FOUND, SURVIVED, UNCLEAR, NOT_RUN))
    return "\n".join([*rows, f"found by kind of test: {', '.join(by) or 'none'}", counts])


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="tests/mutations/run.py",
        description="Put small faults into a copy of the workspace, one at a time, and see whether the tests find "
                    "them. Start it by ./baxter.sh sim, which brings the environment of the tests. Ends with 0 if all "
                    "were found, 1 if not, 77 where the machine allows no overlay.")
    made.add_argument("--list", action="store_true", help="print the faults and end")
    made.add_argument("--check", action="store_true", help="only see that every fault still fits its file")
    made.add_argument("--only", metavar="ID", nargs="+", default=[], help="these faults alone")
    made.add_argument("--sample", metavar="N", type=int, help="N of them at random")
    made.add_argument("--seed", metavar="S", type=int, default=1, help="of --sample; default 1")
    made.add_argument("--out", metavar="FILE", type=Path, help="a CSV file for the results; faults that have a row in "
                                                               "it are not run again")
    made.add_argument("--limit", metavar="SECONDS", type=float, default=LIMIT_S,
                      help=f"a fault whose tests take longer counts as found, if they do not without it; "
                           f"default {LIMIT_S:g}")
    made.add_argument("--faults", metavar="FILE", type=Path, default=FAULTS, help="another list of faults")
    made.add_argument("--root", metavar="FOLDER", type=Path, default=ROOT, help="another workspace")
    return made


def main(arguments: list[str]) -> int:
    options = parser().parse_args(arguments)
    try:
        faults = chosen(read_faults(options.faults), options.only, options.sample, options.seed)
    except (FaultError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    if options.list:
        for fault in faults:
            print(f"{fault.id:28} {fault.kind:20} {fault.by:11} {fault.file}\n    {fault.seen}")
        return 0
    if options.check:
        wrong = problems(faults, options.root)
        print("\n".join([*wrong, f"{len(faults) - len(wrong)} of {len(faults)} faults fit"]))
        return 1 if wrong else 0
    return _run(faults, Trial(options.root.resolve(), options.limit), options.out)


def _run(faults: list[Fault], trial: Trial, out: Path | None) -> int:
    try:
        trial.check_machine()
    except NoOverlay as error:
        print(f"skipped: an overlay in a mount name space needs root, or user name spaces: {error}", file=sys.stderr)
        return EXIT_SKIPPED
    earlier = {} if out is None else {one.id: one for one in results_in(out)}
    results = []
    for fault in faults:
        result = earlier.get(fault.id)
        if result is None:
            result = trial.run(fault)
            print(f"{result.outcome} {result.id} ({result.seconds:.0f} s) {result.failing_test}", flush=True)
            if out is not None:
                append(out, result)
        results.append(result)
    print(table(results))
    return 0 if all(one.outcome == FOUND for one in results) else 1


if __name__ == "__main__":
    # A script's background job ignores Ctrl-C, and an end by SIGTERM would leave the tests of a fault running.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
