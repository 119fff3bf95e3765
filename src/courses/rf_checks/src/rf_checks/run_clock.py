# SPDX-License-Identifier: BSD-3-Clause
"""The clock of a checked program: simulated time in a page of memory that the program can read.

student/sitecustomize.py replaces Python's own clocks and `time.sleep` by it. Free of ROS; Linux only.
"""
from __future__ import annotations

import ctypes
import errno
import fcntl
import mmap
import os
import platform
import struct
import tempfile
import time

#: The environment variable with the number of the page's descriptor.
VARIABLE = "LAB_RUN_CLOCK"
#: The futex word, which changes with each step and is odd while the page is written; unused; then in ns: simulated time
#: since the start, monotonic time of the last step, wall time and monotonic time of the start.
PAGE = struct.Struct("<IIqqqq")
_CONTENT = 8
_FUTEX = {"x86_64": 202, "aarch64": 98}
_FUTEX_WAKE, _EVERYBODY = 1, 2**31 - 1
# linux/fcntl.h: a program that opens the page again by its name in /proc can neither truncate it, which would crash the
# judge, nor write to it.
_ADD_SEALS, _SEALS = 1033, 0x1 | 0x2 | 0x4 | 0x10  # seals, shrink, grow, future writes


class RunClock:
    """Advances only by :meth:`advance`. Must be closed."""

    def __init__(self) -> None:
        writable, can_be_sealed = _new_page()
        try:
            os.ftruncate(writable, mmap.PAGESIZE)
            self._page = mmap.mmap(writable, mmap.PAGESIZE)
            if can_be_sealed:
                fcntl.fcntl(writable, _ADD_SEALS, _SEALS)
            #: For the program: a read-only descriptor.
            self.descriptor = os.open("/proc/self/fd/%d" % writable, os.O_RDONLY)
        finally:
            os.close(writable)
        self._libc = ctypes.CDLL(None)
        self._simulated_ns = 0
        self._start = time.time_ns(), time.monotonic_ns()
        self._write()

    @property
    def environment(self) -> dict[str, str]:
        """Variables for the program's environment: dict."""
        return {VARIABLE: str(self.descriptor)}

    def advance(self, step_s: float) -> None:
        """Advance simulated time by `step_s` and wake all sleepers."""
        self._simulated_ns += round(step_s * 1e9)
        self._write()
        if platform.machine() in _FUTEX:
            address = ctypes.c_char.from_buffer(self._page)
            self._libc.syscall(ctypes.c_long(_FUTEX[platform.machine()]), ctypes.byref(address), _FUTEX_WAKE,
                               ctypes.c_int(_EVERYBODY), None, None, 0)
            del address

    def close(self) -> None:
        os.close(self.descriptor)
        self._page.close()

    def _write(self) -> None:
        content = PAGE.pack(0, 0, self._simulated_ns, time.monotonic_ns(), *self._start)
        # Not by struct.pack_into: it clears its target first, and 0 is even.
        word = ctypes.c_uint32.from_buffer(self._page)
        word.value += 1
        self._page[_CONTENT:PAGE.size] = content[_CONTENT:]
        word.value += 1


def _new_page():
    """(descriptor, whether it can be sealed) of a file in memory without a name."""
    try:
        return os.memfd_create("run-clock", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING), True
    except OSError as error:
        if error.errno != errno.ENOSYS:
            raise
    # In the lab of a class (processes.system_calls), where programs are their author's own risk.
    with tempfile.TemporaryFile(dir="/dev/shm") as file:
        return os.dup(file.fileno()), False
