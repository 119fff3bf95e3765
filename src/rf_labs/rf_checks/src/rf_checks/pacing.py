# SPDX-License-Identifier: BSD-3-Clause
"""When simulated time may go on: as soon as the programs that are watched have nothing to do at this moment.

So a simulation that runs many times faster than real time does not run away from the program in it, however slow or
busy the machine is. Free of ROS; Linux only (/proc).
"""
import contextlib
import os
import time

# How long a program that never rests holds the world up, per record [s].
PATIENCE_S = 0.04
_LOOK_AGAIN_S = 0.0002
_RENEW_THREADS_S = 0.02


def direct_children(pid):
    """Process ids of the children of one process."""
    found = set()
    with contextlib.suppress(OSError):
        for thread in os.listdir("/proc/%d/task" % pid):
            with contextlib.suppress(OSError), open("/proc/%d/task/%s/children" % (pid, thread), "rb") as file:
                found.update(map(int, file.read().split()))
    return found


def children_of(parents):
    """All living descendants of the process ids `parents`, with these."""
    found, to_visit = set(), list(parents)
    while to_visit:
        pid = to_visit.pop()
        if pid in found:
            continue
        if os.path.exists("/proc/%d" % pid):
            found.add(pid)
            to_visit.extend(direct_children(pid))
    return found


def cpu_time_s(pids):
    """Processor time that the processes `pids` have used so far, all threads [s]."""
    total = 0.0
    for pid in pids:
        with contextlib.suppress(OSError):
            # Linux: the CPU clock of another process (man 3 clock_getcpuclockid).
            total += time.clock_gettime((~pid << 3) | 2)
    return total


class Watch:
    """Tells whether any thread of some processes runs, or waits for a processor."""

    def __init__(self):
        self.roots = ()
        self._files = {}
        self._renew_at = 0.0

    def is_busy(self):
        """One look at all threads of `roots` (process ids) and their descendants."""
        now = time.monotonic()
        if now >= self._renew_at:
            self._renew()
            self._renew_at = now + _RENEW_THREADS_S
        for key, file in list(self._files.items()):
            try:
                text = os.pread(file, 200, 0)
            except OSError:
                os.close(self._files.pop(key))
                continue
            state = text[text.rfind(b")") + 2:][:1]
            if state == b"R":
                return True
        return False

    def wait_until_idle(self, patience_s=PATIENCE_S):
        """Wait until nothing runs, at most so long [s]; True when nothing does."""
        deadline = time.monotonic() + patience_s
        # Two looks: while Python hands its lock from thread to thread, neither runs for a moment.
        while self.is_busy() or self.is_busy():
            if time.monotonic() > deadline:
                return False
            time.sleep(_LOOK_AGAIN_S)
        return True

    def close(self):
        self.roots = ()
        for file in self._files.values():
            os.close(file)
        self._files = {}

    def _renew(self):
        living = set()
        for pid in children_of(self.roots):
            with contextlib.suppress(OSError):
                living.update((pid, int(thread)) for thread in os.listdir("/proc/%d/task" % pid))
        for key in self._files.keys() - living:
            os.close(self._files.pop(key))
        for pid, thread in living - self._files.keys():
            with contextlib.suppress(OSError):
                self._files[pid, thread] = os.open("/proc/%d/task/%d/stat" % (pid, thread), os.O_RDONLY | os.O_CLOEXEC)
