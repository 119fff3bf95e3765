# SPDX-License-Identifier: BSD-3-Clause
"""Which transforms have changed, and when they are looked at. No ROS."""
from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from typing import Any

_LOG = logging.getLogger("tf2_web_republisher")
#: Lookups of one subscription [Hz].
SLOWEST_HZ, USUAL_HZ, FASTEST_HZ = 0.1, 10.0, 100.0

Quaternion = tuple[float, float, float, float]  #: x, y, z, w
Found = tuple[tuple[float, float, float], Quaternion, Any]  #: position [m], orientation, what belongs to them

class FrameWatch:
    """The transforms of some frames against a target frame, when they have changed.

    Thresholds in rad and m. ``lookup(target, source)`` returns ((x, y, z), (x, y, z, w), anything) or None.
    """

    def __init__(self, target: str, sources: list[str], angle: float, distance: float) -> None:
        self._target = clean(target)
        self._sources = list(dict.fromkeys(map(clean, sources)))
        self._angle = angle
        self._distance = distance
        self._sent: dict[str, Found] = {}

    def changed(self, lookup: Callable[[str, str], Found | None]) -> list[Found]:
        """Results of ``lookup`` for the frames that have moved since they were last returned."""
        found = []
        for source in self._sources:
            transform = lookup(self._target, source)
            if transform is None:
                continue
            last = self._sent.get(source)
            if last is None or math.dist(transform[0], last[0]) > self._distance \
                    or angle_between(transform[1], last[1]) > self._angle:
                self._sent[source] = transform
                found.append(transform)
        return found


class Audience:
    """Tells when nobody has listened to a topic for a while: its pages have gone without a word. ``clock()`` [s]."""

    def __init__(self, timeout_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._timeout_s = timeout_s
        self._clock = clock
        self._heard_s = clock()

    def is_gone(self, listeners: int) -> bool:
        """Whether there have been no ``listeners`` (their number now) for longer than the timeout."""
        now_s = self._clock()
        if listeners:
            self._heard_s = now_s
        return now_s - self._heard_s > self._timeout_s


def clean(frame: str) -> str:
    """A frame's name as tf2 has it, without a leading slash."""
    return frame.lstrip("/")


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """The angle between two orientations (quaternions of length 1) [rad]."""
    return 2 * math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b, strict=True)))))


def period_of(rate: float) -> float:
    """Seconds between two lookups at ``rate`` [Hz]; the usual rate where none, or no number, is given."""
    if not rate > 0:
        rate = USUAL_HZ
    return 1 / min(max(rate, SLOWEST_HZ), FASTEST_HZ)


class WallSchedule:
    """Calls functions periodically in one thread, in wall time: a page that opens while the simulation is paused sees
    the robot, too.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._jobs: dict[Callable[[], bool | None], list[float]] = {}  # [next time, period] of each function
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="schedule", daemon=True)
        self._thread.start()

    def add(self, function: Callable[[], bool | None], period_s: float) -> None:
        """Call ``function()`` at once, and then every ``period_s`` until it returns False or raises."""
        with self._changed:
            self._jobs[function] = [time.monotonic(), period_s]
            self._changed.notify()

    def remove(self, function: Callable[[], bool | None]) -> None:
        with self._changed:
            self._jobs.pop(function, None)

    def end(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(5.0)

    def _run(self) -> None:
        while (function := self._next()) is not None:
            try:
                goes_on = function()
            except Exception:
                # The subscription of one page; the others go on.
                _LOG.exception("a subscription ends")
                goes_on = False
            with self._changed:
                job = self._jobs.get(function)
                if goes_on is False:
                    self._jobs.pop(function, None)
                elif job is not None:
                    job[0] = max(job[0] + job[1], time.monotonic())

    def _next(self) -> Callable[[], bool | None] | None:
        with self._changed:
            while not self._ended:
                due = min(self._jobs, key=lambda function: self._jobs[function][0], default=None)
                wait_s = None if due is None else self._jobs[due][0] - time.monotonic()
                if wait_s is not None and wait_s <= 0:
                    return due
                self._changed.wait(wait_s)
        return None
