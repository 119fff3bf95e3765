# SPDX-License-Identifier: BSD-3-Clause
"""Maintenance: the procedures that tare an arm and calibrate it, and the updater, as far as a simulated robot has them.

A procedure runs while its client keeps asking for it and the robot is enabled. Here it watches the arm's joints at
rest: it succeeds when what they exert is, on average, what their model says, and fails when something leans on the arm.
"""
import numpy as np

from .collision import SQUISH_NM

STATUS_RATE_HZ = 10.0
KEEP_ALIVE_S = 1.5  # [simulated s] the physical robot wants a message faster than 1 Hz; clients send two a second
DURATION_S = 5.0  # [simulated s] of a procedure
# A joint of an arm on which nothing leans differs from its model by less than this part of what counts as a squeeze.
TOLERANCE = 0.1
NOT_COMPLETE, FAILURE, SUCCESS = 0, 1, 2  # RobustControllerStatus.complete

PROCEDURES = {"Tare": "tares", "CalibrateArm": "calibrates"}  # by the name of its topics

UPDATER_IDLE, UPDATER_INVALID = 0, 1  # UpdateStatus.status


class Procedure:
    """One procedure on one arm. `complete`, `uid`, `timed_out`, `errors`, `is_enabled` are the fields of its status."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.is_enabled = self.timed_out = False
        self.complete, self.uid, self.errors = NOT_COMPLETE, "", []
        self._begin = self._last = 0.0
        self._sum, self._count = np.zeros(len(SQUISH_NM)), 0

    def take(self, wanted, uid, time_s):
        """A client asks for the procedure, or for its end, at time_s [s]."""
        if not wanted:
            self.is_enabled = False
        elif not self.is_enabled:
            self.reset()
            self.is_enabled, self.uid, self._begin = True, uid, time_s
        self._last = time_s

    @property
    def is_running(self):
        return self.is_enabled and self.complete == NOT_COMPLETE

    def update(self, time_s, robot_enabled, torques):
        """Go on, at time_s [s]; torques: (7,) from outside [Nm] that the arm's joints feel now."""
        if self.is_enabled and time_s - self._last > KEEP_ALIVE_S:
            self.is_enabled, self.timed_out = False, True
        if not self.is_running:
            return
        self._sum += torques
        self._count += 1
        if not robot_enabled:
            self._fail("the robot is disabled")
        elif time_s - self._begin >= DURATION_S:
            mean = np.abs(self._sum / self._count)
            bound = TOLERANCE * np.array(list(SQUISH_NM.values()))
            wrong = ["%s feels %.1f Nm too much, at most %.1f are allowed" % (name, found, allowed)
                     for name, found, allowed in zip(SQUISH_NM, mean, bound, strict=True) if found > allowed]
            if wrong:
                self._fail(*wrong)
            else:
                self.complete = SUCCESS

    def _fail(self, *reasons):
        self.complete, self.errors = FAILURE, list(reasons)


class Updater:
    """What becomes of a wish to update: there is nothing to update from."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.status, self.description = UPDATER_IDLE, "idle"

    def start(self, uuid):
        self.status = UPDATER_INVALID
        self.description = "there is no update '%s': no stick is plugged into a simulated robot" % uuid
