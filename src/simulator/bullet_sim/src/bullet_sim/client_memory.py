# SPDX-License-Identifier: BSD-3-Clause
"""Gives back memory that a new physics client has filled with zeros: 22 MB of the 31 MB that PyBullet takes for it."""

import ctypes
import mmap
import os
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

# Smaller areas are not worth a look [bytes].
_LARGE = 8 << 20
_DONTNEED = 4  # of madvise(2): the pages are filled with zeros when they are used again

Areas = list[tuple[int, int]]


class Taken(NamedTuple):
    """Of this process: its threads, and (start, end) of its writable memory that belongs to no file, ascending. Both
    are empty on a system without Linux's lists of them."""

    threads: frozenset[str]
    areas: Areas


def taken() -> Taken:
    """What this process has taken by now."""
    found: Areas = []
    try:
        threads = frozenset(os.listdir("/proc/self/task"))
        with open("/proc/self/maps", encoding="utf-8", errors="replace") as lines:
            for line in lines:
                addresses, mode, _, _, inode, *name = line.split(maxsplit=5)
                if mode == "rw-p" and inode == "0" and not name:
                    start, end = addresses.split("-")
                    found.append((int(start, 16), int(end, 16)))
    except OSError:
        return Taken(frozenset(), [])
    return Taken(threads, found)


def give_back(before: Taken) -> int:
    """Give back the pages full of zeros in large areas that are not in ``before``, an earlier :func:`taken`; return
    their size [bytes].

    Only the call that takes the memory may be in between. Where a thread has begun meanwhile, all is kept: one of the
    areas may be its stack, in which it writes at any moment.
    """
    now, released = taken(), 0
    if not before.threads or now.threads != before.threads:
        return 0
    forget = ctypes.PyDLL(None).madvise  # keeps the interpreter's lock, other than one of CDLL
    for start, end in added(before.areas, now.areas):
        if end - start < _LARGE:
            continue
        area = (ctypes.c_char * (end - start)).from_address(start)
        is_used = np.frombuffer(area, np.uint64).reshape(-1, mmap.PAGESIZE // 8).any(axis=1)
        for first, last in _runs(~is_used):
            size = (last - first) * mmap.PAGESIZE
            if forget(ctypes.c_void_p(start + first * mmap.PAGESIZE), ctypes.c_size_t(size), _DONTNEED) == 0:
                released += size
    return released


def added(before: Areas, after: Areas) -> Iterator[tuple[int, int]]:
    """Yield the parts (start, end) of ``after`` that ``before`` does not have; both ascending."""
    for start, end in after:
        for old_start, old_end in before:
            if old_end <= start or end <= old_start:
                continue
            if start < old_start:
                yield start, old_start
            start = old_end
        if start < end:
            yield start, end


def _runs(flags: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield (first, behind the last) of each run of true ``flags`` (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.view(np.int8), [0]))))
    yield from edges.reshape(-1, 2).tolist()
