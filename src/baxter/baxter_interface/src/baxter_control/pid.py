# SPDX-License-Identifier: BSD-3-Clause
"""A PID controller for one quantity. Loads without ROS; its time is ROS time unless another clock is given."""

from __future__ import annotations

from collections.abc import Callable


def _ros_time():
    import rospy  # Imported late, so that a caller with a clock of its own needs no ROS.

    return rospy.get_time()


class PID:
    """Output = kp e + ki (integral of e) + kd (de/dt), for an error e that the caller passes at any time.

    Parameters: the gains; `now`, a function that reads a clock [s], ROS time by default.
    """

    def __init__(self, kp: float = 0.0, ki: float = 0.0, kd: float = 0.0, now: Callable[[], float] = _ros_time) -> None:
        self._kp, self._ki, self._kd = kp, ki, kd
        self._now = now
        self.initialize()

    def initialize(self) -> None:
        """Forget the past: integral and derivative begin with the next error."""
        self._integral = 0.0
        self._last_error = None
        self._last_s = 0.0

    def set_kp(self, kp: float) -> None:
        """Set the proportional gain [output per error]."""
        self._kp = kp

    def set_ki(self, ki: float) -> None:
        """Set the integral gain [output per error and s]."""
        self._ki = ki

    def set_kd(self, kd: float) -> None:
        """Set the derivative gain [output s per error]."""
        self._kd = kd

    def compute_output(self, error: float) -> float:
        """Return the output for the present `error`.

        The first call after initialize() has neither integral nor derivative. A call at which the clock did not advance
        (a paused or reset simulation) has no derivative.
        """
        now_s = self._now()
        derivative = 0.0
        if self._last_error is not None:
            step_s = now_s - self._last_s
            if step_s > 0.0:
                self._integral += error * step_s
                derivative = (error - self._last_error) / step_s
        self._last_error, self._last_s = error, now_s
        return self._kp * error + self._ki * self._integral + self._kd * derivative
