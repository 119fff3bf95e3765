# SPDX-License-Identifier: BSD-3-Clause
"""The dialogue with a procedure that runs on the robot itself, such as taring an arm. Free of ROS.

The procedure runs while the request is repeated, at least once a second, and reports when it has begun and how it
ended.
"""
from __future__ import annotations

import enum
import errno
from dataclasses import dataclass

# Requests to the procedure are repeated this often [s].
REQUEST_EVERY_S = 0.5
# Time limits for its start, and for its end after the request to stop [s].
ANSWER_TIMEOUT_S = 10.0


class DialogueState(enum.IntEnum):
    IDLE = 0
    STARTING = 1
    RUNNING = 2
    STOPPING = 3


class Completion(enum.IntEnum):
    """As in baxter_core_msgs/RobustControllerStatus."""

    NOT_COMPLETE = 0
    FAILURE = 1
    SUCCESS = 2


@dataclass(frozen=True)
class ProcedureReport:
    """The procedure's last report."""

    is_enabled: bool
    complete: int = Completion.NOT_COMPLETE
    errors: tuple = ()


class Dialogue:
    """One run of a procedure, stepped with its reports and the time since the run began.

    Attributes:
        state: a DialogueState; IDLE again when the run is over.
        failure: (errno, text) of the failure, None without one.
    """

    def __init__(self, timeout_s: float) -> None:
        self.state = DialogueState.STARTING
        self.failure: tuple[int, str] | None = None
        self._timeout_s = timeout_s
        self._stopping_since_s = 0.0
        self._next_request_s = 0.0

    def step(self, elapsed_s: float, report: ProcedureReport | None) -> bool | None:
        """Take the latest ProcedureReport (None as long as there is none) and return the request due now: True for
        "run", False for "stop", None for none."""
        if self.state is DialogueState.STARTING:
            self._start(elapsed_s, report)
        elif self.state is DialogueState.RUNNING and report is not None:
            self._run(elapsed_s, report)
        if self.state is DialogueState.STOPPING:
            self._stop(elapsed_s, report)
        if self.state is DialogueState.IDLE or elapsed_s < self._next_request_s:
            return None
        self._next_request_s = elapsed_s + REQUEST_EVERY_S
        return self.state is not DialogueState.STOPPING

    def abort(self, elapsed_s: float) -> None:
        """Abort the run: request the procedure to stop."""
        self._end(elapsed_s, (errno.ECONNABORTED, "broken off"))

    def _start(self, elapsed_s: float, report: ProcedureReport | None) -> None:
        if report is not None and report.is_enabled:
            self.state = DialogueState.RUNNING
        elif elapsed_s >= min(ANSWER_TIMEOUT_S, self._timeout_s):
            self._end(elapsed_s, (errno.ETIMEDOUT, "it did not begin within %.0f s" % elapsed_s))

    def _run(self, elapsed_s: float, report: ProcedureReport) -> None:
        errors = ": " + ", ".join(report.errors) if report.errors else ""
        if report.complete == Completion.SUCCESS:
            self._end(elapsed_s, None)
        elif report.complete == Completion.FAILURE:
            self._end(elapsed_s, (errno.EIO, "the robot reports a failure" + errors))
        elif not report.is_enabled:
            self.state = DialogueState.IDLE
            self.failure = (errno.ENOMSG, "it ended without saying how" + errors)
        elif elapsed_s >= self._timeout_s:
            self._end(elapsed_s, (errno.ETIMEDOUT, "it was not complete after %.0f s" % elapsed_s))

    def _end(self, elapsed_s: float, failure: tuple[int, str] | None) -> None:
        self.state = DialogueState.STOPPING
        self.failure = failure
        self._stopping_since_s = self._next_request_s = elapsed_s

    def _stop(self, elapsed_s: float, report: ProcedureReport | None) -> None:
        if elapsed_s <= self._stopping_since_s:
            return  # send one stop request, whatever it reports
        if report is None or not report.is_enabled:
            self.state = DialogueState.IDLE
        elif elapsed_s - self._stopping_since_s >= ANSWER_TIMEOUT_S:
            self.state = DialogueState.IDLE
            self.failure = self.failure or (errno.ETIMEDOUT, "it is complete, but did not stop when requested")
