# SPDX-License-Identifier: BSD-3-Clause
"""Priorities of processes: physics comes first, but nothing that a user waits for may starve. Free of ROS.

Linux may put all processes of a session into one group. Groups share the processors equally, and a nice value then
counts only within its group ("The autogroup feature", sched(7)). roslaunch starts each node in a session of its own, so
the group of the node has to give way as well.
"""
from __future__ import annotations

import concurrent.futures
import contextlib
import os
from collections.abc import Callable
from typing import Any

_OWN_GROUP = "/proc/self/autogroup"
_before: concurrent.futures.ThreadPoolExecutor | None = None


def give_way(niceness: int) -> None:
    """Lower the priority of this thread, of all that it starts, and of the session where this process leads one.

    ``niceness``: 1 to 19, the lowest; it adds up. Call it before other threads are started.
    """
    global _before
    if _before is None:
        _before = concurrent.futures.ThreadPoolExecutor(1, "before_giving_way")
        _before.submit(int).result()  # Linux has a priority for each thread, and this one keeps it
    os.nice(niceness)
    # Elsewhere the group is that of a terminal, with other programs in it.
    if os.getsid(0) == os.getpid():
        # Not all kernels have such groups.
        with contextlib.suppress(OSError), open(_OWN_GROUP, "w", encoding="ascii") as file:
            file.write(str(os.nice(0)))


def as_before(function: Callable, *arguments: Any, **named: Any) -> Any:
    """Return ``function(*arguments)`` of a thread with the priority from before :func:`give_way`: a process that it
    starts does not inherit the lower one, which cannot be raised again. Start it with a separate session."""
    if _before is None:
        return function(*arguments, **named)
    return _before.submit(function, *arguments, **named).result()
