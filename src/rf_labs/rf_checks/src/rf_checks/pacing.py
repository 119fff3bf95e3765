# SPDX-License-Identifier: BSD-3-Clause
"""Let simulated time go on as soon as the watched programs are idle.

So a simulation that runs many times faster than real time does not run away from the program in it, however slow or
busy the machine is: what is counted is the processor time that processes got, never the time on the wall in which they
waited for a processor. Free of ROS; Linux only (/proc).
"""
import contextlib
import os
import time

#: Processor time per record [s] for which a program that does not rest holds the world up, and its helpers.
PROGRAM_ALLOWANCE_S = 0.04
HELPERS_ALLOWANCE_S = 0.4
_LOOK_AGAIN_S, _LOOK_AGAIN_AT_MOST_S = 0.0002, 0.004
_LOADAVG = "/proc/loadavg"


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


def is_running(pid):
    """Whether a process is there and has not ended: one that only waits to be asked for its exit status has."""
    try:
        with open("/proc/%d/stat" % pid, "rb") as file:
            text = file.read()
    except OSError:
        return False
    return text[text.rfind(b")") + 2:][:1] not in (b"Z", b"X")


def cpu_time_s(pids):
    """Processor time that the processes `pids` have used so far, all threads [s]."""
    total = 0.0
    for pid in pids:
        with contextlib.suppress(OSError):
            # Linux: the CPU clock of another process (man 3 clock_getcpuclockid).
            total += time.clock_gettime((~pid << 3) | 2)
    return total


def last_process():
    """The number of the newest process or thread on this machine: as long as it stays, there is no new one."""
    with open(_LOADAVG, "rb") as file:
        return file.read().split()[-1]


class Tree:
    """Some processes with all their descendants: what their threads do, and what they have used."""

    def __init__(self, roots=()):
        """`roots`: process ids."""
        self.roots = tuple(roots)
        #: Processor time that was used since the beginning [s]; of processes that ended, what was last seen.
        self.used_s = 0.0
        self._seen_s = {}
        self._files = {}
        self._renewed_at = None

    def renew(self):
        """Look which processes and threads there are, if there can be new ones."""
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

    def count(self):
        """Bring `used_s` up to date and return it."""
        for pid, seen in self._seen_s.items():
            now = cpu_time_s((pid,))
            if now > seen:
                self.used_s += now - seen
                self._seen_s[pid] = now
        return self.used_s

    def runs(self):
        """Whether any thread runs, waits for a processor, or waits for a disk."""
        for key, file in list(self._files.items()):
            try:
                text = os.pread(file, 200, 0)
            except OSError:
                os.close(self._files.pop(key))
                continue
            if text[text.rfind(b")") + 2:][:1] in (b"R", b"D"):
                return True
        return False

    def rests(self):
        """Whether nothing runs, nor ran while this looked."""
        before = self.count()
        # While threads wake each other one after the other, each may rest at the moment at which it is looked at.
        return not self.runs() and self.count() == before

    def close(self):
        self.roots = ()
        for file in self._files.values():
            os.close(file)
        self._files = {}
        self._seen_s = {}
        self._renewed_at = None


class Watch:
    """Tells when a program and its helpers have nothing to do at this moment."""

    def __init__(self):
        #: Helpers: processes on whose answers the program waits.
        self.program, self.helpers = Tree(), Tree()
        #: Asked now and then; True ends a wait.
        self.gives_up = lambda: False

    def wait_until_rest(self):
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
            time.sleep(pause_s)
            program.renew()
            helpers.renew()
            pause_s = min(1.2 * pause_s, _LOOK_AGAIN_AT_MOST_S)

    def close(self):
        self.program.close()
        self.helpers.close()


class OwnTime:
    """How long some processes have had to do something: wall time while they rest, else their processor time.

    On a machine that does nothing else that is wall time; where they wait for a processor, none passes.
    """

    def __init__(self, roots):
        """`roots`: function that returns process ids."""
        self._roots = roots
        self._tree = Tree()
        self.restart()

    def restart(self):
        """Begin at zero."""
        self._passed_s = 0.0
        self._tree.roots = tuple(self._roots())
        self._tree.renew()
        self._used_s, self._looked_at = self._tree.count(), time.monotonic()

    def passed_s(self):
        """To be asked several times a second."""
        self._tree.roots = tuple(self._roots())
        self._tree.renew()
        now, used_s = time.monotonic(), self._tree.count()
        self._passed_s += used_s - self._used_s if self._tree.runs() else now - self._looked_at
        self._used_s, self._looked_at = used_s, now
        return self._passed_s

    def close(self):
        self._tree.close()
