# SPDX-License-Identifier: BSD-3-Clause
"""Memory that the kernel keeps for programs outside of their processes: files in memory, and sockets. Free of ROS;
Linux only."""
from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable

from processes.isolation import FOLDERS, HOME

#: The folders of a sandbox that are in memory where its home is on a disk.
SCRATCH = tuple(folder for folder in FOLDERS if folder != HOME)
#: What the kernel needs for a file or folder in memory, even an empty one with a short name [bytes].
ENTRY_BYTES = 1 << 10


def root_of(pids: Iterable[int]) -> str:
    """The topmost folder of the sandbox that some of these processes are in, seen from outside; "" without one."""
    outside = os.stat("/")
    for pid in pids:
        root = "/proc/%d/root" % pid
        with contextlib.suppress(OSError):
            # Bubblewrap itself stays outside.
            if not os.path.samestat(os.stat(root), outside):
                return root
    return ""


def files_in_memory(root: str, folders: Iterable[str] = SCRATCH) -> tuple[int, int]:
    """(entries, bytes) of a sandbox's folders in memory; empty files need memory, too.

    root: by `root_of`. Raises OSError once the process of that root has ended.
    """
    found = [os.statvfs(root + folder) for folder in folders]
    entries = sum(one.f_files - one.f_ffree for one in found)
    return entries, sum((one.f_blocks - one.f_bfree) * one.f_frsize for one in found) + ENTRY_BYTES * entries


def sockets(pids: Iterable[int]) -> int:
    """How many sockets these processes have open; one that several share counts once."""
    found = set()
    for pid in pids:
        with contextlib.suppress(OSError), os.scandir("/proc/%d/fd" % pid) as files:
            for file in files:
                with contextlib.suppress(OSError):
                    found.add(os.readlink(file.path))
    return sum(name.startswith("socket:") for name in found)
