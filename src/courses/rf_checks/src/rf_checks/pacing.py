# SPDX-License-Identifier: BSD-3-Clause
"""Steps simulated time as soon as the watched programs are idle.

So a simulation that is many times faster than real time never gets ahead of the program, even on a slow or busy
machine: only the processor time of processes counts, not the wall time in which they wait for a processor. Free of ROS;
Linux only (/proc).
"""
from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Collection, Iterable

from processes.family import children_of

#: Processor time per record [s] for which a busy program, and its helpers, delay the world.
PROGRAM_ALLOWANCE_S = 0.04
HELPERS_ALLOWANCE_S = 0.4
#: Time for which waits for a disk delay the world, in a whole run [s, wall]. The kernel shows a thread that waits for a
#: child's `vfork` in the same way, and that may last for ever.
DISK_ALLOWANCE_S = 30.0
_LOOK_AGAIN_S, _LOOK_AGAIN_AT_MAX_S = 0.0002, 0.004
_LOADAVG = "/proc/loadavg"


def cpu_time_s(pids: Iterable[int]) -> float:
    """Processor time that the processes `pids` have used so far, all threads [s]."""
    total = 0.0
    for pid in pids:
        with contextlib.suppress(OSError):
            # Linux: the CPU clock of another process (man 3 clock_getcpuclockid).
            total += time.clock_gettime((~pid << 3) | 2)
    return total


def last_process() -> bytes:
    """The number of the newest process or thread on this machine: while it does not change, there is no new one."""
    with open(_LOADAVG, "rb") as file:
        return file.read().split()[-1]


class ProcessTree:
    """Some processes with all their descendants: states of their threads, and their processor time."""

    def __init__(self, roots: Collection[int] = ()) -> None:
        """`roots`: process ids."""
        self.roots = roots
        #: Processor time that was used since the beginning [s]; for ended processes, the last known value.
        self.used_s = 0.0
        #: Time in which it did nothing but wait for a disk [s, wall]; `Watch` counts it.
        self.disk_s = 0.0
        self.waits_for_disk = False
        self._seen_s = {}
        self._files = {}
        self._renewed_at = None

    def renew(self) -> None:
        """Update the list of processes and threads, if there may be new ones."""
        newest = self.roots, last_process()
        if newest == self._renewed_at:
            return
        self._renewed_at = newest
        pids = children_of(self.roots)
        living = set()
        for pid in pids:
            self._seen_s.setdefault(pid, 0.0)
            with contextlib.suppress(OSError):
                living.update((pid, int(thread)) for thread in os.listdir("/proc/%d/task" % pid))
        for pid in self._seen_s.keys() - pids:
            del self._seen_s[pid]
        for key in self._files.keys() - living:
            os.close(self._files.pop(key))
        for pid, thread in living - self._files.keys():
            with contextlib.suppress(OSError):
                self._files[pid, thread] = os.open("/proc/%d/task/%d/stat" % (pid, thread), os.O_RDONLY | os.O_CLOEXEC)

    def count(self) -> float:
        """Bring `used_s` up to date and return it."""
        for pid, seen in self._seen_s.items():
            now = cpu_time_s((pid,))
            if now > seen:
                self.used_s += now - seen
                self._seen_s[pid] = now
        return self.used_s

    def runs(self) -> bool:
        """Whether any thread runs, waits for a processor, or waits for a disk within its allowance."""
        self.waits_for_disk = False
        for key, file in list(self._files.items()):
            try:
                text = os.pread(file, 200, 0)
            except OSError:
                os.close(self._files.pop(key))
                continue
            state = text[text.rfind(b")") + 2:][:1]
            if state == b"R":
                self.waits_for_disk = False
                return True
            self.waits_for_disk |= state == b"D"
        return self.waits_for_disk and self.disk_s < DISK_ALLOWANCE_S

    def rests(self) -> bool:
        """Whether nothing runs, or ran during this check."""
        before = self.count()
        # If threads wake each other in turn, each one may be idle at the moment of its check.
        return not self.runs() and self.count() == before

    def close(self) -> None:
        self.roots = ()
        for file in self._files.values():
            os.close(file)
        self._files = {}
        self._seen_s = {}
        self._renewed_at = None


class Watch:
    """Detects when a program and its helpers are idle."""

    def __init__(self) -> None:
        #: Helpers: processes whose responses the program waits for.
        self.program, self.helpers = ProcessTree(), ProcessTree()
        #: Called sometimes; True ends a wait.
        self.gives_up: Callable[[], bool] = lambda: False

    def wait_until_rest(self) -> bool:
        """Wait until nothing runs, or the allowances are used up; True when nothing runs."""
        program, helpers = self.program, self.helpers
        program.renew()
        helpers.renew()
        until = program.count() + PROGRAM_ALLOWANCE_S, helpers.count() + HELPERS_ALLOWANCE_S
        pause_s = _LOOK_AGAIN_S
        while True:
            # The helpers, then the program again: an answer wakes it.
            if program.rests() and helpers.rests() and program.rests():
                return True
            if program.count() > until[0] or helpers.count() > until[1] or self.gives_up():
                return False
            began, waited = time.monotonic(), program.waits_for_disk
            time.sleep(pause_s)
            if waited:
                program.disk_s += time.monotonic() - began
            program.renew()
            helpers.renew()
            pause_s = min(1.2 * pause_s, _LOOK_AGAIN_AT_MAX_S)

    def close(self) -> None:
        self.program.close()
        self.helpers.close()


class OwnTime:
    """Time that processes had for their work: wall time while they are idle, else their processor time.

    On an otherwise idle machine this is wall time; while they wait for a processor, it stands still.
    """

    def __init__(self, roots: Callable[[], Iterable[int]]) -> None:
        """`roots`: function that returns process ids."""
        self._roots = roots
        self._tree = ProcessTree()
        self.restart()

    def restart(self) -> None:
        """Restart at zero."""
        self._passed_s = 0.0
        self._tree.roots = tuple(self._roots())
        self._tree.renew()
        self._used_s, self._looked_at = self._tree.count(), time.monotonic()

    def passed_s(self) -> float:
        """Call it several times a second."""
        self._tree.roots = tuple(self._roots())
        self._tree.renew()
        now, used_s = time.monotonic(), self._tree.count()
        self._passed_s += used_s - self._used_s if self._tree.runs() else now - self._looked_at
        self._used_s, self._looked_at = used_s, now
        return self._passed_s

    def close(self) -> None:
        self._tree.close()
