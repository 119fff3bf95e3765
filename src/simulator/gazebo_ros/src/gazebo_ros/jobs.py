# SPDX-License-Identifier: BSD-3-Clause
"""Forces with a start and a duration. ROS-free; times are integer nanoseconds of simulation."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass
class _Job:
    target: Any
    payload: Any
    start_ns: int
    duration_ns: int
    began_ns: int | None = None


class TimedJobs:
    """Payloads to apply at each tick, by target.

    A job acts in every tick that begins within its duration, counted from the first tick at or after its start: 0.5 s
    are exactly 250 ticks of 2 ms, and a duration between zero and one tick is one tick. A duration of zero does
    nothing, a negative one never ends.
    """

    def __init__(self) -> None:
        self._jobs = []

    def __len__(self) -> int:
        return len(self._jobs)

    def add(self, target: Any, payload: Any, start_ns: int, duration_ns: int) -> None:
        """Apply ``payload`` to ``target`` (anything that can be compared). A start in the past means now."""
        if duration_ns != 0:
            self._jobs.append(_Job(target, payload, start_ns, duration_ns))

    def due(self, now_ns: int) -> list[tuple[Any, Any]]:
        """The (target, payload) pairs for the tick that begins at ``now_ns``, in the order they were added."""
        if not self._jobs:
            return []
        found, left = [], []
        for job in self._jobs:
            if job.began_ns is None and now_ns >= job.start_ns:
                job.began_ns = now_ns
            if job.began_ns is not None:
                if 0 <= job.duration_ns <= now_ns - job.began_ns:
                    continue
                found.append((job.target, job.payload))
            left.append(job)
        self._jobs = left
        return found

    def remove(self, concerns: Callable[[Any], bool]) -> None:
        """Drop the jobs with ``concerns(target)`` true."""
        self._jobs = [job for job in self._jobs if not concerns(job.target)]
