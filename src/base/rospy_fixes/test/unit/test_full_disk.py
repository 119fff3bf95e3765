# SPDX-License-Identifier: BSD-3-Clause
"""Log files on a full disk. On /dev/full there is no room for anything."""
import subprocess
import sys
from pathlib import Path

import pytest

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))
PROGRAM = """
import logging, rosgraph.roslogging
log = logging.getLogger("rosout")
log.addHandler(logging.FileHandler("%s"))
for number in range(3):
    log.error(%s, number)
print("done")
"""


@pytest.fixture
def logged(tmp_path):
    """Run a program that logs three messages into a file: (its output, its errors)."""
    (tmp_path / "rosgraph").mkdir()
    for name in ("__init__", "roslogging"):
        (tmp_path / "rosgraph" / (name + ".py")).write_text("rospkg = configure_logging = None")

    def run(file, text):
        done = subprocess.run([sys.executable, "-c", PROGRAM % (file, text)], capture_output=True, text=True,
                              env={"PYTHONPATH": "%s:%s" % (OURS, tmp_path), "PATH": "/usr/bin:/bin"})
        return done.stdout, done.stderr
    return run


def test_a_full_disk_is_told_once_and_the_program_goes_on(logged):
    output, errors = logged("/dev/full", "'message %d'")
    assert output == "done\n"
    line, = errors.splitlines()
    assert line.startswith("the log file /dev/full has no more room: No space left on device.") and "rosclean" in line


def test_other_errors_of_logging_are_reported_as_ever(logged, tmp_path):
    output, errors = logged(tmp_path / "log", "'message %d %d'")
    assert output == "done\n" and errors.count("not enough arguments for format string") == 3
