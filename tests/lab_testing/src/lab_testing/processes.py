# SPDX-License-Identifier: BSD-3-Clause
"""Which processes are alive. Zombies are not, although they still accept signals."""
import contextlib
from pathlib import Path


def is_alive(pid):
    """Whether the process runs, sleeps or is stopped."""
    try:
        return _stat(Path("/proc") / str(pid))[0] not in "ZX"
    except OSError:
        return False


def living(group):
    """Command lines of the living processes of a process group."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, _, its_group = _stat(folder)[:3]
            if int(its_group) == group and state not in "ZX":
                found.append((folder / "cmdline").read_text().replace("\0", " "))
    return found


def _stat(folder):
    """Fields of /proc/PID/stat from the state on, see proc(5)."""
    return (folder / "stat").read_text().rpartition(")")[2].split()
