# SPDX-License-Identifier: BSD-3-Clause
"""Processes and their descendants, as /proc shows them. Linux only."""
from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable

# How the kernel names shared memory without a file.
_SHARED = b" /dev/zero (deleted)"
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


def with_parent(command: Iterable[str], sign: str = "KILL") -> list[str]:
    """The command (list) that runs another one and ends it by a signal at the end of the process that starts it.

    Also where that process ends before the signal is ordered: then the command does not begin. sign: the signal's name.
    To be called by the process that starts it; of its threads, the one that starts it must last as long. The command
    gets the signal also where this process ignores it, as everything ignores Ctrl-C's in a script's background job.
    """
    heeds = [] if sign.removeprefix("SIG") == "KILL" else ["env", "--default-signal=" + sign]
    return [*heeds, "setpriv", "--pdeathsig", sign, "--", "/bin/sh", "-c", '[ "$PPID" = "$0" ] && exec "$@"',
            str(os.getpid()), *command]


def direct_children(pid: int) -> set[int]:
    """Process ids of the children of one process."""
    found: set[int] = set()
    with contextlib.suppress(OSError):
        for thread in os.listdir("/proc/%d/task" % pid):
            with contextlib.suppress(OSError), open("/proc/%d/task/%s/children" % (pid, thread), "rb") as file:
                found.update(map(int, file.read().split()))
    return found


def children_of(parents: Iterable[int]) -> set[int]:
    """All living descendants of the process ids `parents`, with these."""
    found: set[int] = set()
    to_visit = list(parents)
    while to_visit:
        pid = to_visit.pop()
        if pid in found:
            continue
        if os.path.exists("/proc/%d" % pid):
            found.add(pid)
            to_visit.extend(direct_children(pid))
    return found


def is_running(pid: int) -> bool:
    """Whether a process is running; a zombie is not."""
    try:
        with open("/proc/%d/stat" % pid, "rb") as file:
            text = file.read()
    except OSError:
        return False
    return text[text.rfind(b")") + 2:][:1] not in (b"Z", b"X")


def memory_exceeds(pids: Iterable[int], limit_bytes: float) -> bool:
    """Whether processes have more memory than ``limit_bytes`` together: their private pages, and what they share with
    each other; pages of files do not count."""
    private = reserved = 0
    for pid in pids:
        with contextlib.suppress(OSError, ValueError, IndexError), open("/proc/%d/statm" % pid, "rb") as file:
            words = file.read().split()
            private += max(0, int(words[1]) - int(words[2])) * _PAGE_BYTES
            reserved += int(words[0]) * _PAGE_BYTES
    if private > limit_bytes:
        return True
    # Most programs need no look at their mappings.
    return reserved > limit_bytes and private + _shared_bytes(pids) > limit_bytes


def _shared_bytes(pids: Iterable[int]) -> int:
    """Shared mappings without a file: their whole size, since pages that a process has given back stay in memory."""
    mappings = {}
    for pid in pids:
        with contextlib.suppress(OSError, ValueError, IndexError), open("/proc/%d/maps" % pid, "rb") as file:
            for line in file:
                if _SHARED in line:
                    area, _, offset, device, inode = line.split()[:5]
                    start, end = (int(part, 16) for part in area.split(b"-"))
                    mappings[(device, inode, offset)] = max(end - start, mappings.get((device, inode, offset), 0))
    return sum(mappings.values())
