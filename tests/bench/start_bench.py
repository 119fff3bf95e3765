# SPDX-License-Identifier: BSD-3-Clause
"""The time from roslaunch to a robot that is ready, the memory of every process of the lab, its cost at rest."""
import contextlib
import os
import tempfile
import time
from pathlib import Path

from labs import HERE, Lab, Process, memory_mb

from lab_testing.waiting import wait_until
from processes.family import children_of

# What has only started still loads and connects [s, simulated], and the wall time that may take; how long a lab is
# watched at rest [s].
SETTLE_S, LIMIT_S, RESTING_S = 3.0, 60.0, 10.0
# A launch file with one empty node measures the time of roslaunch and rospy alone.
EMPTY = '<launch><node name="bench_empty" pkg="workspace_tests" type="lab_part.py" args="empty"/></launch>'


def _cpu_s(processes):
    """CPU time of processes that may have ended [s]."""
    total = 0.0
    for process in processes:
        with contextlib.suppress(OSError):
            total += process.cpu_s()
    return total


def measure(report, quick, number):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "empty.launch"
        file.write_text(EMPTY)
        assert (HERE / "lab_part.py").exists()
        with Lab((str(file),), "/bench_empty") as lab:
            bare_s = lab.started_s
            node = next(name for name in lab.nodes() if name.startswith("/bench_empty"))
            bare_mb = memory_mb(lab.process(node).pid)
    with Lab(gui="false") as lab:
        report.add("launch to /robot/sim/started", lab.started_s, "s", ("one empty node", bare_s), most=5.0)
        used = {}
        for node in lab.nodes():
            try:
                pid = lab.process(node).pid
                if pid not in used:  # one process may have several names
                    used[pid] = memory_mb(pid)
                    report.add("memory of %s" % node, used[pid], "MB", ("empty rospy node", bare_mb))
            except (OSError, TypeError):
                continue  # a node that has ended, such as spawn_model
        report.add("memory of all nodes", sum(used.values()), "MB", most=290.0)
        settled = lab.now() + SETTLE_S
        wait_until(lambda: lab.now() >= settled, "the lab to settle", LIMIT_S)
        processes, begin = [Process(pid) for pid in children_of([os.getpid()]) - {os.getpid()}], time.monotonic()
        before = _cpu_s(processes)
        time.sleep(1.0 if quick else RESTING_S)
        share = 100.0 * (_cpu_s(processes) - before) / (time.monotonic() - begin)
        report.add("a resting lab in real time, all processes", share, "% of a core", most=18.0)
