# SPDX-License-Identifier: BSD-3-Clause
"""Run a judged program on simulated time: `time.sleep(1)` lasts one simulated second.

rospy_fixes' sitecustomize runs this module when Python starts, because the judge puts its folder right behind in
PYTHONPATH. So a program that waits with `time` instead of rospy works with any speed of the simulation, and so do
rospy's own time-outs. rf_checks/run_clock.py has the other side and the layout of the page.
"""
import contextlib
import ctypes
import mmap
import os
import platform
import struct
import threading
import time

_VARIABLE = "LAB_RUN_CLOCK"
_PAGE = struct.Struct("<IIqqqq")  # as in run_clock.py
_STEP_S = 0.01
_FUTEX = {"x86_64": 202, "aarch64": 98}
_FUTEX_WAIT = 0
# A sleeper checks the clock at least with this period [s].
_LOOK_UP_S = 0.5

_real_sleep, _real_monotonic_ns = time.sleep, time.monotonic_ns


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


class _RunClock:
    """The page that the judge writes, read."""

    def __init__(self, descriptor: int) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._libc.mmap.restype = ctypes.c_void_p
        self._libc.mmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int,
                                    ctypes.c_long)
        self._futex = _FUTEX[platform.machine()]
        # Not by Python's mmap: the futex below needs the address, and ctypes gives none for a read-only page.
        address = self._libc.mmap(None, mmap.PAGESIZE, mmap.PROT_READ, mmap.MAP_SHARED, descriptor, 0)
        if address == ctypes.c_void_p(-1).value:
            raise OSError(ctypes.get_errno(), "the clock's page cannot be read")
        self._address: int = address
        self._pause = _Timespec(0, round(_LOOK_UP_S * 1e9))
        self._own = threading.local()
        *_, self._wall_ns, self._monotonic_ns = self._read()

    def _read(self):
        while True:
            words = _PAGE.unpack(ctypes.string_at(self._address, _PAGE.size))
            # Odd while it is written.
            if words[0] % 2 == 0 and ctypes.c_uint.from_address(self._address).value == words[0]:
                return words
            _real_sleep(0)

    def elapsed_ns(self) -> int:
        """Simulated time since the run's start; between two steps it grows more and more slowly, but never stops."""
        _, _, simulated_ns, moved_at_ns, _, _ = self._read()
        since, step = max(0, _real_monotonic_ns() - moved_at_ns), _STEP_S * 1e9
        return simulated_ns + int(step * since / (since + step))

    def time_ns(self) -> int:
        return self.elapsed_ns() + self._wall_ns

    def monotonic_ns(self) -> int:
        return self.elapsed_ns() + self._monotonic_ns

    def sleep(self, seconds: float) -> None:
        """`time.sleep`, in simulated time."""
        if not seconds > 0.0:
            _real_sleep(seconds)  # yields, or raises for a wrong argument
            return
        sequence, _, now_ns, *_ = self._read()
        # Sleeps shorter than a step add up to one.
        due = self._own.due = max(getattr(self._own, "due", 0.0), now_ns * 1e-9) + seconds
        while now_ns * 1e-9 + _STEP_S <= due:
            self._libc.syscall(ctypes.c_long(self._futex), ctypes.c_void_p(self._address), _FUTEX_WAIT,
                               ctypes.c_uint(sequence), ctypes.byref(self._pause), None, 0)
            sequence, _, now_ns, *_ = self._read()


def _install(descriptor):
    clock = _RunClock(descriptor)
    time.sleep = clock.sleep
    time.time_ns, time.monotonic_ns, time.perf_counter_ns = clock.time_ns, clock.monotonic_ns, clock.monotonic_ns
    time.time = lambda: clock.time_ns() * 1e-9
    time.monotonic = time.perf_counter = lambda: clock.monotonic_ns() * 1e-9


# Without the page (a child that did not inherit it), wall time is used.
with contextlib.suppress(KeyError, ValueError, OSError):
    _install(int(os.environ[_VARIABLE]))
