# SPDX-License-Identifier: BSD-3-Clause
"""The time from roslaunch to a robot that is ready, and the memory of every process of the lab."""
import tempfile
from pathlib import Path

from labs import HERE, Lab, memory_mb

# A launch file with one empty node measures the time of roslaunch and rospy alone.
EMPTY = '<launch><node name="bench_empty" pkg="workspace_tests" type="lab_part.py" args="empty"/></launch>'


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
        total = 0.0
        for node in lab.nodes():
            try:
                used = memory_mb(lab.process(node).pid)
            except (OSError, TypeError):
                continue  # a node that has ended, such as spawn_model
            total += used
            report.add("memory of %s" % node, used, "MB", ("empty rospy node", bare_mb))
        report.add("memory of all nodes", total, "MB")
