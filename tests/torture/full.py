# SPDX-License-Identifier: BSD-3-Clause
"""Small full file systems, and checks of a lab on them."""
import contextlib
import os
import shutil
import subprocess
import time
from pathlib import Path

from journal import Skip
from robot import LabError, Robot

BLOCK = 1 << 16


def require_root():
    """Raises Skip if file systems cannot be mounted."""
    if os.geteuid() != 0 or not shutil.which("unshare"):
        raise Skip("mounting a small file system takes root")
    if subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode:
        raise Skip("root may not mount anything on this machine (a container?)")


def fill(folder):
    """Write a file until the file system is full; return its path."""
    path = Path(folder) / "filler"
    with path.open("wb", buffering=0) as stream, contextlib.suppress(OSError):
        while stream.write(b"\0" * BLOCK) == BLOCK:
            pass
        while stream.write(b"\0"):
            pass
    return path


def bear(lab, watch, options, journal, minutes):
    """Check again and again that the arms follow commands and that every node runs; failures go to the journal."""
    robot, processes = Robot(watch), lab.processes()
    until = time.monotonic() + 60.0 * minutes
    number = 0
    while number < 3 or time.monotonic() < until:
        journal.note(number, "the arms", "follow", "")
        try:
            robot.follow()
            dead = [node for node, pid in processes.items() if lab.pid(node) != pid]
            problems = watch.take_found() + ["%s died or does not answer" % node for node in dead]
        except (LabError, OSError) as error:
            problems = [*watch.take_found(), "%s: %s" % (type(error).__name__, error)]
        if problems:
            journal.fail("; ".join(problems[:5]), options.seed, number, 1)
            if any("died" in text for text in problems):
                return
        number += 1
