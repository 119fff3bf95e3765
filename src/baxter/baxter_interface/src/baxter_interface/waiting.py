# SPDX-License-Identifier: BSD-3-Clause
"""Wait for several conditions in order, in wall time, with one line of progress. Free of ROS."""
from __future__ import annotations

import difflib
import errno
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from command_line.waiting_line import WaitingLine

# A wait that is shorter than this prints nothing [s].
FIRST_NOTICE_S = 1.0
POLL_S = 0.05
# A wait that is longer says what was found so far [s].
REASON_AFTER_S = 5.0
# Period of the checks whether the awaited thing is starting [s].
LOOK_EVERY_S = 1.0


def others_than(name: str, known: Any) -> Any:
    """The text after "there is no topic" (or service) `name`: those of the `known` names that may have been meant.

    Names that differ in one part are of the same kind, such as the channels of a robot. Of others, the most similar.
    """
    parts, kinds = name.split("/"), {}
    for other in known:
        words = other.split("/")
        places = [place for place, word in enumerate(words) if len(words) == len(parts) and word != parts[place]]
        if len(places) == 1:
            kinds.setdefault(places[0], set()).add(words[places[0]])
    if not kinds:
        near = difflib.get_close_matches(name, list(known))
        return near and "; the most similar: %s" % ", ".join(near) or ""
    place, words = max(kinds.items(), key=lambda kind: len(kind[1]))
    near = difflib.get_close_matches(parts[place], sorted(words))
    return "%s; in place of %s there are %s" % (
        near and ". Is %s meant" % " or ".join(near) or "", parts[place], ", ".join(sorted(words)))


@dataclass(frozen=True)
class Condition:
    """Something to wait for.

    Attributes:
        what: its name, in "waiting for <what>". is_met: returns whether it is there. explain: returns what was found
        instead and what would be right; called once in a long wait, and after it has failed.
    """

    what: str
    is_met: Callable[[], bool]
    explain: Callable[[], str]


def wait_in_order(conditions: list[Condition], timeout_s: float, line: WaitingLine | None = None,
                  is_coming: Callable[[], bool] = lambda: False, is_shutdown: Callable[[], bool] = lambda: False,
                  now: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep) -> None:
    """Wait until each of `conditions` has been met, in their order, for `timeout_s` in all.

    Parameters:
        line: a command_line.waiting_line.WaitingLine, which shows what is waited for; None: nothing is shown.
        is_coming: returns whether the awaited thing is starting, called once a second; while it is true, the time limit
        does not run. It may raise an OSError, which ends the wait. is_shutdown: ends the wait. now, sleep: the clock
        [s], wall time by default because no other time is reliable while a robot starts.
    Raises OSError with errno ETIMEDOUT, or ESHUTDOWN.
    """
    begin_s = now()
    deadline_s = begin_s + timeout_s
    look_at_s = begin_s + LOOK_EVERY_S
    try:
        for condition in conditions:
            reason_at_s = begin_s + REASON_AFTER_S
            while not condition.is_met():
                if is_shutdown():
                    raise OSError(errno.ESHUTDOWN, "ROS is shutting down; was waiting for %s" % condition.what)
                if now() >= min(look_at_s, deadline_s):
                    if is_coming():
                        deadline_s, reason_at_s = now() + timeout_s, now() + REASON_AFTER_S
                    look_at_s = now() + LOOK_EVERY_S
                if now() >= deadline_s:
                    raise OSError(errno.ETIMEDOUT, "waited %.0f s for %s: %s"
                                  % (now() - begin_s, condition.what, condition.explain()))
                if line and now() - begin_s >= FIRST_NOTICE_S:
                    line.say(condition.what, now() - begin_s)
                    if now() >= reason_at_s:
                        line.note("still waiting for %s: %s" % (condition.what, condition.explain()))
                        reason_at_s = float("inf")
                sleep(POLL_S)
    finally:
        if line:
            line.end()
