# SPDX-License-Identifier: BSD-3-Clause
"""Finds threads that still compute after the last test.

Such a thread, a server on a closed socket for example, takes processor time from all tests that follow: ten times as
long, without a word. A run of single files finds the one that leaves it.
"""
import os
import threading
import time

# Wall time of a look [s], and the share of a core from which on something runs. Compilers' threads end soon.
_LOOK_S, _SHARE = 0.2, 0.5
_LOOKS = 15


def is_busy() -> bool:
    """Whether this process computes, or would if it had a processor, while this thread waits, in each of some looks."""
    for _ in range(_LOOKS):
        begin, before = time.monotonic(), _wanted_s()
        time.sleep(_LOOK_S)
        least, after = _SHARE * (time.monotonic() - begin), _wanted_s()
        if not any(wanted - before.get(thread, wanted) >= least for thread, wanted in after.items()):
            return False
    return True


def _wanted_s():
    """{thread: processor time and time of waiting for a processor [s]}, and of the whole process {0: processor time}.

    Source: schedstat in https://docs.kernel.org/filesystems/proc.html; without it, there is only the process.
    """
    found = {0: time.process_time()}
    for task in os.listdir("/proc/self/task"):
        try:
            with open("/proc/self/task/%s/schedstat" % task, encoding="ascii") as stream:
                ran, waited, _ = stream.read().split()
        except OSError:
            continue
        found[int(task)] = 1e-9 * (int(ran) + int(waited))
    return found


def busy_ones() -> str:
    """The names of this process's threads where one of them computes; else an empty text."""
    return ", ".join(sorted({thread.name for thread in threading.enumerate()})) if is_busy() else ""
