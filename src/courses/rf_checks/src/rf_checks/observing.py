# SPDX-License-Identifier: BSD-3-Clause
"""Decides at each record whether a run is over, by simulated time and the program's processor time. Free of ROS."""
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from baxter_model import SIDES
from rf_checks import diagnosis
from rf_checks.recording import RECORD_S

if TYPE_CHECKING:
    from rf_checks.sandbox import RunningProgram
    from rf_checks.tasks import ProgramCall

#: A program that is almost never idle for this much processor time counts as an endless computation [s]; "almost never"
#: is this share of the records.
BUSY_S, BUSY_SHARE = 8.0, 0.3
#: Processor time [s] that the lab's nodes may use in a run, and what is added for each simulated second. The world
#: waits for them: a program that only waits for requests without end would hold it up to the wall limit.
HELPERS_S, HELPERS_PER_S = 60.0, 5.0
# After a program's end the robot is observed until it has rested for QUIET_S, at most SETTLE_S [sim s].
SETTLE_S, QUIET_S, STILL_RAD = 1.5, 0.3, 1e-4
# Period of expensive checks, in records.
_LOOK_AT_GRAPH, _LOOK_AT_FAMILY = 25, 5


class Observer:
    """Takes the records of one run. When the run is over the world waits until :meth:`release`."""

    def __init__(self, call: ProgramCall[Any], student: RunningProgram, is_satisfied: Callable[[str], bool],
                 look_at_graph: Callable[[], bool]) -> None:
        """`is_satisfied(output)`: whether the judge has seen enough; `look_at_graph()`: whether the lab was changed."""
        self.records: list[dict[str, Any]] = []
        self.ended = ""
        self.student = student
        self._call = call
        self._is_satisfied = is_satisfied
        self._look_at_graph = look_at_graph
        self._window = round(diagnosis.FLOOD_WINDOW_S / RECORD_S)
        self._busy_since, self._busy_cpu_s = 0, 0.0
        # The number of records at the program's end; 0 while it runs.
        self._exited_at = 0
        self._over, self._released = threading.Event(), threading.Event()
        # Records come in one thread, an external end in another: the first end counts.
        self._lock = threading.Lock()

    def on_record(self, record: dict[str, Any], cpu_s: float) -> None:
        """One record, and the processor time that the program has used so far [s]."""
        with self._lock:
            if not self._over.is_set():
                self._take(record, cpu_s)
        if self._over.is_set():
            self._released.wait()

    def _take(self, record: dict[str, Any], cpu_s: float) -> None:
        self.records.append(record)
        if not self._exited_at:
            self.ended = self._end(record, cpu_s)
            if self.ended == "exited":
                record["exited"] = record["t"]
                self._exited_at = len(self.records)
        if self.ended and (self.ended != "exited" or self._has_settled()):
            self._over.set()

    def wait(self, timeout_s: float) -> bool:
        """Whether the run is over; waits at most this long for it."""
        return self._over.wait(timeout_s)

    def end(self, how: str) -> None:
        """End the run from outside."""
        with self._lock:
            if not self._over.is_set():
                self.ended = how
                self._over.set()

    def release(self) -> None:
        """Let the world continue; call it when the run is processed."""
        self._over.set()
        self._released.set()

    def _end(self, record: dict[str, Any], cpu_s: float) -> str:
        count = len(self.records)
        if self.student.exit_code is not None:
            # Check once more: a program that ended at once may have done it before.
            return "meddled" if self._look_at_graph() else "exited"
        if count % _LOOK_AT_GRAPH == 0 and self._look_at_graph():
            return "meddled"
        excess = self.student.excess() if count % _LOOK_AT_FAMILY == 0 else ""
        if excess:
            return excess
        earlier = self.records[max(0, count - 1 - self._window)]
        if sum(record["counts"][side] - earlier["counts"][side] for side in SIDES) > diagnosis.FLOOD_COMMANDS:
            return "flood"
        if cpu_s - self._busy_cpu_s > BUSY_S:
            if np.mean([past["rested"] for past in self.records[self._busy_since:]]) < BUSY_SHARE:
                return "busy"
            self._busy_since, self._busy_cpu_s = count, cpu_s
        helpers_s = record["helpers_s"] - self.records[0]["helpers_s"]
        if helpers_s > HELPERS_S + HELPERS_PER_S * count * RECORD_S:
            return "requests"
        if count * RECORD_S > self._call.limit_s:
            return "sim time"
        return "satisfied" if self._is_satisfied(self.student.output) else ""

    def _has_settled(self) -> bool:
        since = len(self.records) - self._exited_at
        quiet = round(QUIET_S / RECORD_S)
        recent = np.array([record["q"] for record in self.records[-quiet:]])
        return since * RECORD_S >= SETTLE_S or (since > quiet and np.ptp(recent, axis=0).max() < STILL_RAD)
