# SPDX-License-Identifier: BSD-3-Clause
"""A standard output whose reader has ended, as in `program | head`. No ROS; Linux."""
from __future__ import annotations

import os
import select
import sys


def is_lost() -> bool:
    """Whether the standard output is a pipe or a socket that nobody reads any more. If so, its descriptor goes to
    /dev/null from then on: what Python still holds back for it causes no second error."""
    try:
        descriptor = sys.stdout.fileno()
        watch = select.poll()
        # An error is reported without being asked for.
        watch.register(descriptor, 0)
        lost = any(events & (select.POLLERR | select.POLLHUP) for _, events in watch.poll(0))
    except (AttributeError, OSError, ValueError):
        return False
    if lost:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), descriptor)
    return lost
