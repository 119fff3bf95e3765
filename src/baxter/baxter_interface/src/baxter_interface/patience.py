# SPDX-License-Identifier: BSD-3-Clause
"""Waiting for things that come up one after the other, in wall time, aloud. Free of ROS."""
import errno
import time
from collections.abc import Callable
from dataclasses import dataclass

# A start that is quicker than this passes without a word [s].
FIRST_NOTICE_S = 1.0
NOTICE_EVERY_S = 4.0
POLL_S = 0.05


@dataclass(frozen=True)
class Condition:
    """Something to wait for.

    Attributes:
        what: names it, in "waiting for <what>".
        is_met: tells whether it is there.
        explain: says what was found instead and what would be right; called once, after the wait was in vain.
    """

    what: str
    is_met: Callable[[], bool]
    explain: Callable[[], str]


def wait_in_order(conditions, timeout_s, say, is_shutdown=lambda: False, now=time.monotonic, sleep=time.sleep):
    """Wait until each of `conditions` has been met, in their order, for `timeout_s` in all.

    Parameters: `say` takes a line of text, every few seconds; `is_shutdown` ends the wait; `now` and `sleep` are the
    clock [s], wall time by default because nothing else can be relied on while a robot starts.
    Raises OSError with errno ETIMEDOUT, or ESHUTDOWN.
    """
    begin_s = now()
    notice_s = begin_s + FIRST_NOTICE_S
    for condition in conditions:
        while not condition.is_met():
            if is_shutdown():
                raise OSError(errno.ESHUTDOWN, "ROS is shutting down; was waiting for %s" % condition.what)
            if now() - begin_s >= timeout_s:
                raise OSError(errno.ETIMEDOUT, "waited %.0f s for %s: %s"
                              % (timeout_s, condition.what, condition.explain()))
            if now() >= notice_s:
                say("waiting for %s ..." % condition.what)
                notice_s = now() + NOTICE_EVERY_S
            sleep(POLL_S)
