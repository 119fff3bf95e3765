# SPDX-License-Identifier: BSD-3-Clause
"""The folders of a lab that are in memory, /tmp and /dev/shm among them: their number of files, which Linux does not
limit in a way that this user could set, and, where no control group counts it, their memory. Free of ROS; Linux only.
"""
from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from processes import usage

#: Most files and folders of a lab in memory. Each takes a kilobyte of the kernel's.
ENTRIES = 100_000
#: Most sockets of a lab, where no control group counts the memory of their buffers.
SOCKETS = 4000


class Scratch:
    """Of all labs of a class."""

    def __init__(self) -> None:
        self._roots = {}

    def exceeded(self, name: str, family: Callable[..., Any]) -> str:
        """Why a lab is to end, or "". It costs so little that it can be asked several times a second.

        family: a function that returns the process ids of this lab.
        """
        entries, _ = self._look(name, family)
        if entries <= ENTRIES:
            return ""
        return ("it has made %d files and folders in /tmp and other folders in memory, and may have %d"
                % (entries, ENTRIES))

    def bytes(self, name: str, family: Callable[..., Any]) -> int:
        """Memory of the files in these folders [bytes]; 0 before the lab has them. family: as in `exceeded`."""
        return self._look(name, family)[1]

    def ended(self, name: str) -> None:
        """The processes of a lab have ended, and its folders with them."""
        self._roots.pop(name, None)

    def _look(self, name: str, family: Callable[[], Any]) -> tuple[int, int]:
        root = self._roots.get(name)
        if root is None:
            root = self._roots[name] = usage.root_of(family())
        if root:
            try:
                return usage.files_in_memory(root)
            except OSError:
                pass  # the process by which the root was known has ended
        self._roots.pop(name, None)
        return 0, 0


def too_many_sockets(pids: Iterable[int]) -> str:
    """Why a lab of these processes is to end, or ""."""
    found = usage.sockets(pids)
    return "" if found <= SOCKETS else "it has opened %d sockets, and may have %d" % (found, SOCKETS)
