# SPDX-License-Identifier: BSD-3-Clause
"""Processes and their descendants, as /proc shows them. Linux only."""
import contextlib
import os


def with_parent(command, sign="KILL"):
    """The command (list) that runs another one and ends it by a signal at the end of the process that starts it.

    Also where that process ends before the signal is ordered: then the command does not begin. sign: the signal's name.
    To be called by the process that starts it; of its threads, the one that starts it must last as long.
    """
    return ["setpriv", "--pdeathsig", sign, "--", "/bin/sh", "-c", '[ "$PPID" = "$0" ] && exec "$@"', str(os.getpid()),
            *command]


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
    """Whether a process is running; a zombie is not."""
    try:
        with open("/proc/%d/stat" % pid, "rb") as file:
            text = file.read()
    except OSError:
        return False
    return text[text.rfind(b")") + 2:][:1] not in (b"Z", b"X")
