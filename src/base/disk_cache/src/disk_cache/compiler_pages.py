# SPDX-License-Identifier: BSD-3-Clause
"""Gives back the memory that holds the compiler itself. Free of ROS.

A program whose functions come from the cache runs the compiler's machine code once, when they are loaded; 40 MB of it
would stay in memory.
"""
from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

_LIBRARY = "libllvmlite"
# Of madvise(2): the pages are read from the file again when they are needed.
_DONTNEED = 4


def release(maps: Path = Path("/proc/self/maps"), forget: Callable[[int, int], object] | None = None) -> int:
    """Give back the pages of the compiler's machine code; return the size of their address range [bytes].

    Call it when all functions have been loaded. The compiler still works: its pages are read again. Returns 0 where
    there is no ``maps``, a file like Linux's /proc/self/maps, or where the compiler is not loaded. forget(start,
    size): replaces the call of the operating system.
    """
    try:
        lines = maps.read_text().splitlines()
    except OSError:
        return 0
    released = 0
    for line in lines:
        addresses, mode, *rest = line.split(maxsplit=5)
        # Code alone: it is never written to, so that nothing is lost.
        if mode != "r-xp" or not Path(rest[-1]).name.startswith(_LIBRARY):
            continue
        start, end = (int(address, 16) for address in addresses.split("-"))
        (forget or _forget)(start, end - start)
        released += end - start
    return released


def _forget(start: int, size: int) -> None:
    ctypes.CDLL(None).madvise(ctypes.c_void_p(start), ctypes.c_size_t(size), _DONTNEED)
