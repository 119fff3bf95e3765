# SPDX-License-Identifier: BSD-3-Clause
"""Run .test files through rostest: own master, own log and result folders, a time limit, nothing left behind."""

import os
import shutil
import signal
import subprocess
import sys
import uuid
from pathlib import Path
from xml.etree import ElementTree

from lab_tests import processes, shared_labs
from lab_tests.discovery import is_long, runs_in_real_time
from lab_tests.results import Tally, failure, read_rostest_results
from processes.ports import free_port

TIME_LIMIT_S = 240.0
LONG_TIME_LIMIT_S = 1200.0
# roslaunch gives a node 15 s after SIGINT and 2 s after SIGTERM before it kills it.
STOP_TIMEOUT_S = 20.0
LEFTOVER_GRACE_S = 2.0
OUTPUT_LINES_SHOWN = 80
# Environment variable with the factor of time limits, for rostest and for the tests' own deadlines
# (lab_testing.waiting).
STRETCH_VARIABLE = "LAB_TEST_STRETCH"
# Simulated time by wall time in labs whose launch names none, and the variable that launch files read it from.
SPEED, SPEED_VARIABLE = 3.0, "LAB_REAL_TIME_FACTOR"
STRETCHED_ROSTEST = Path(__file__).with_name("stretched_rostest.py")


def declared_s(path: Path) -> float:
    """Sum of the time limits of a file's tests, plus a minute for start and end."""
    return 60.0 + sum(float(test.get("time-limit", 60.0)) for test in ElementTree.parse(path).getroot().iter("test"))


def run(
    path: Path, work_folder: Path, environment: dict[str, str], time_limit_s: float | None = None, stretch: float = 1.0
) -> Tally:
    """Run it and count. work_folder is emptied first; logs and results stay in it. environment: of all its processes.

    stretch: factor of all time limits, including those in the file, when the processes get only a part of the machine.
    """
    _empty(work_folder)
    tally = _run(path, [], work_folder, environment, time_limit_s, stretch, runs_in_real_time(path))
    return _with_output(tally, path, work_folder)


def run_shared(
    paths: list[Path], work_folder: Path, environment: dict[str, str], stretch: float = 1.0
) -> dict[Path, Tally]:
    """Run files that share a lab, and count each one; as :func:`run` otherwise.

    After a file that leaves the lab in another state, the others get a new lab.
    """
    _empty(work_folder)
    tallies: dict[Path, Tally] = {}
    waiting = list(paths)
    while waiting:
        folder = work_folder / str(len(tallies))
        _empty(folder)
        launch, results = shared_labs.write(waiting, folder)
        owner = ["--package", "lab_testing", "--pkgdir", str(folder)]
        whole = _run(launch, owner, folder, environment, None, stretch, runs_in_real_time(paths[0]))
        ran = [path for path, result in zip(waiting, results, strict=True) if result.is_dir()] or waiting[:1]
        for path, result in zip(ran, results, strict=False):
            tallies[path] = read_rostest_results(result)
        # The node that ran them is no test, but may have failed as one.
        whole.passed = 0
        tallies[ran[-1]].add(whole)
        tallies[ran[-1]] = _with_output(tallies[ran[-1]], launch, folder)
        waiting = waiting[len(ran):]
    return tallies


def _empty(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "results").mkdir(parents=True)


def _with_output(tally: Tally, path: Path, work_folder: Path) -> Tally:
    if tally.failed:
        lines = (work_folder / "output.txt").read_text(errors="replace").splitlines()
        tail = "\n".join(lines[-OUTPUT_LINES_SHOWN:])
        tally.details.append(f"output of {path.name} (logs in {work_folder}):\n{tail}")
    return tally


def _run(
    path: Path, options: list[str], work_folder: Path, environment: dict[str, str], time_limit_s: float | None,
    stretch: float, in_real_time: bool,
) -> Tally:
    if time_limit_s is None:
        time_limit_s = stretch * max(LONG_TIME_LIMIT_S if is_long(path) else TIME_LIMIT_S, declared_s(path))
    run_id = uuid.uuid4().hex
    environment = {
        **environment,
        processes.MARKER: run_id,
        # rostest opens a master on a free port of its own. Nothing answers at this one, so that a process that ignores
        # rostest's setting finds no master, instead of a running lab of the user.
        "ROS_MASTER_URI": f"http://localhost:{free_port()}",
        "ROS_HOSTNAME": "localhost",
        "ROS_LOG_DIR": str(work_folder / "log"),
        "ROS_TEST_RESULTS_DIR": str(work_folder / "results"),
        STRETCH_VARIABLE: f"{stretch:g}",
        SPEED_VARIABLE: f"{1.0 if in_real_time else SPEED:g}",
    }
    command = ["rostest"] if stretch == 1.0 else [sys.executable, str(STRETCHED_ROSTEST)]
    output = work_folder / "output.txt"
    code: int | None = None  # None: not finished in time
    with output.open("wb") as stream:
        child = None
        try:
            # Do not trust the results of rostest --text (it exits with 0 when tests fail), but the XML files.
            child = subprocess.Popen(
                [*command, *options, str(path)],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            code = child.wait(time_limit_s)
        except subprocess.TimeoutExpired:
            _stop(child)
        except BaseException:  # Ctrl-C, perhaps while it starts: end the test's processes, too
            if child is not None:
                _stop(child)
            processes.kill_all(run_id)
            raise
    tally = Tally()
    leftovers = processes.wait_until_gone(run_id, LEFTOVER_GRACE_S)
    processes.kill_all(run_id)
    if code is None:
        tally.add(failure(f"{path.name}: not finished after {time_limit_s:.0f} s"))
    else:
        tally.add(read_rostest_results(work_folder / "results"))
        if code != 0 and tally.failed == 0:
            tally.add(failure(f"{path.name}: rostest ended with exit code {code}"))
        if leftovers:
            listing = "\n".join(f"  {pid}: {command}" for pid, command in sorted(leftovers.items()))
            tally.add(failure(f"{path.name}: left processes behind (killed now):\n{listing}"))
    return tally


def _stop(child):
    """End rostest the way Ctrl-C does, so that it can end its nodes; then by force."""
    for sign in (signal.SIGINT, signal.SIGKILL):
        try:
            os.killpg(child.pid, sign)
            child.wait(STOP_TIMEOUT_S)
            return
        except ProcessLookupError:
            return
        except subprocess.TimeoutExpired:
            print(f"rostest does not stop on {signal.Signals(sign).name}", file=sys.stderr)
