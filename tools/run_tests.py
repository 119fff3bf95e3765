#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh test`: lint, unit tests, unit tests under a comma-decimal locale, rostests; one line of counts last."""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

from lab_tests import comma_locale, rostests
from lab_tests.discovery import SelectionError, select, take_inventory
from lab_tests.results import Tally, failure, read_junit

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / ".baxter" / "tests"
LINT_COMMANDS = {
    "ruff": [sys.executable, "-m", "ruff", "check", "--quiet", str(ROOT)],
    # Offline: with rosdep's database its verdict would depend on whether somebody ran `rosdep update`.
    "catkin_lint": ["catkin_lint", "--offline", "--strict", "--quiet", "-W1", str(ROOT / "src")],
}
PYTEST_NO_TESTS_COLLECTED = 5


def run_linter(name: str) -> Tally:
    done = subprocess.run(LINT_COMMANDS[name], capture_output=True, text=True, cwd=ROOT)
    if done.returncode == 0:
        return Tally(passed=1)
    return failure(f"{name}:\n{done.stdout}{done.stderr}".rstrip())


def run_unit(title: str, targets, arguments, environment=None) -> Tally:
    """One pytest process; its own output goes straight to the terminal."""
    report = WORK / f"{title}.xml"
    report.unlink(missing_ok=True)
    options = ["-q", "--continue-on-collection-errors", f"--junitxml={report}", *arguments]
    command = [sys.executable, "-m", "pytest", *options, *targets]
    done = subprocess.run(command, cwd=ROOT, env=environment)
    if done.returncode == PYTEST_NO_TESTS_COLLECTED:
        return Tally()
    if not report.is_file():
        return failure(f"{title}: pytest died with exit code {done.returncode} before it wrote its report")
    tally = read_junit(report)
    tally.details.clear()  # pytest has shown them
    if done.returncode != 0 and tally.failed == 0:
        tally.add(failure(f"{title}: pytest ended with exit code {done.returncode}"))
    return tally


def run_unit_under_comma_locale(targets) -> Tally:
    try:
        environment = comma_locale.environment(WORK.parent / "locale")
    except (OSError, subprocess.CalledProcessError) as error:
        detail = getattr(error, "stderr", None) or ""
        return failure(f"cannot make the locale {comma_locale.NAME}: {error}\n{detail}")
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT / "tools"), environment.get("PYTHONPATH")]))
    # What takes long or builds has nothing to do with decimal points.
    arguments = ["-p", "lab_tests.comma_locale", "-m", "not long and not build"]
    return run_unit("unit-comma-locale", targets, arguments, environment)


def layers(selection, long: bool):
    """(title, function that runs it) of everything chosen, fastest first."""
    for name in selection.linters:
        yield name, lambda name=name: run_linter(name)
    if selection.unit_targets:
        # Whoever names a single test means it, long or not; a -m of the user's own comes later and wins.
        is_single = any("::" in target for target in selection.unit_targets)
        marker = [] if long or is_single else ["-m", "not long"]
        yield "unit tests", lambda: run_unit("unit", selection.unit_targets, marker + selection.pytest_arguments)
        if selection.is_whole_suite:
            yield (
                f"unit tests under {comma_locale.NAME}",
                lambda: run_unit_under_comma_locale(selection.unit_targets),
            )
    for test in selection.rostests:
        folder = WORK / f"{test.package}-{test.path.stem}"
        yield f"{test.package} {test.path.name}", lambda test=test, folder=folder: rostests.run(test, folder)


def main() -> int:
    parser = argparse.ArgumentParser(prog="./baxter.sh test", allow_abbrev=False, add_help=False)
    parser.add_argument("--long", action="store_true")
    options, arguments = parser.parse_known_args()
    WORK.mkdir(parents=True, exist_ok=True)
    try:
        selection = select(take_inventory(ROOT), arguments, options.long)
    except SelectionError as error:
        print(error, file=sys.stderr)
        return 2

    total = Tally()
    for title, run in layers(selection, options.long):
        print(f"=== {title}", flush=True)
        started = time.monotonic()
        tally = run()
        for detail in tally.details:
            print(detail)
        verdict = "FAILED" if tally.failed else "ok" if tally.passed else "nothing to run"
        counts = f"{tally.passed} passed, {tally.failed} failed, {tally.skipped} skipped"
        print(f"--- {title}: {verdict} ({counts}; {time.monotonic() - started:.1f} s)", flush=True)
        total.add(tally)
    if total.passed + total.failed == 0:
        print("No test ran.")
    print(f"{total.passed} passed, {total.failed} failed", flush=True)
    return 0 if total.passed and not total.failed else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
