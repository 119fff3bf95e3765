# SPDX-License-Identifier: BSD-3-Clause
"""Maintenance: the procedures that tare an arm and calibrate it, and the updater, as far as a simulated robot has them.

A procedure runs while its client repeats the request and the robot is enabled. It moves the arm through postures around
the neutral one and measures its joints at rest in each. It succeeds when the mean efforts agree with the model, and
fails when something presses on the arm or keeps it from a posture. The postures of the physical robot are not public.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from baxter_model import JOINTS, MIRROR_SIGNS, SIDES, poses

from .collision import SQUISH_NM

if TYPE_CHECKING:
    from collections.abc import Sequence

STATUS_RATE_HZ = 10.0
KEEP_ALIVE_S = 1.5  # [simulated s] the physical robot wants a message faster than 1 Hz; clients send two a second
REST_S = 2.0  # [simulated s] in each posture, of which the second half counts: what was set in motion has died down
ARRIVAL_S = 30.0  # [simulated s] in which a posture must be reached: the longest way takes 2 s, 20 s at a ratio of 0.1
NEAR_RAD = 0.01
# Largest deviation of a free arm's joint from its model, as a share of the squeeze threshold.
TOLERANCE = 0.1
NOT_COMPLETE, FAILURE, SUCCESS = 0, 1, 2  # RobustControllerStatus.complete

# By the name of its topics: its description, and its postures, each as differences to the neutral one on the left arm
# [rad]. Taring concerns the shoulder's spring; calibration concerns every joint, and turns each one to both sides.
PROCEDURES = {
    "Tare": ("tares", ({}, {"s1": -0.3}, {"s1": 0.2, "e1": 0.3}, {"s1": -0.2, "e1": 0.5}, {})),
    "CalibrateArm": ("calibrates", ({}, *({joint: turn} for joint, size in zip(
        JOINTS, (0.3, 0.2, 0.5, 0.3, 0.8, 0.5, 0.8), strict=True) for turn in (size, -size)), {})),
}

UPDATER_IDLE, UPDATER_INVALID = 0, 1  # UpdateStatus.status


def postures(name: str, side: str) -> list[np.ndarray]:
    """The postures (7,) [rad], shoulder to wrist, of a procedure of PROCEDURES for one arm."""
    neutral = np.array(list(poses().angles("neutral", side).values()))
    signs = np.array([1 if side == SIDES[0] else MIRROR_SIGNS[joint] for joint in JOINTS])
    return [neutral + signs * [turns.get(joint, 0.0) for joint in JOINTS] for turns in PROCEDURES[name][1]]


class ProcedureArm(NamedTuple):
    """The state of the arm for a procedure, (7,) each: position [rad], velocity [rad/s], torques from outside [Nm]."""

    position: np.ndarray
    velocity: np.ndarray
    torques: np.ndarray


class Order(Enum):
    """A request of a procedure to the arm other than a posture."""

    NOTHING = "nothing"
    STOP = "stop"


class Procedure:
    """One procedure on one arm. `complete`, `uid`, `timed_out`, `errors`, `is_enabled` are the fields of its status.

    way: sequence of postures (7,) [rad].
    """

    def __init__(self, way: Sequence[np.ndarray]) -> None:
        self._way = way
        self.reset()

    def reset(self) -> None:
        self.is_enabled = self.timed_out = False
        self.complete, self.uid, self.errors = NOT_COMPLETE, "", []
        self._last = 0.0  # when the client asked for it
        self._moves = False  # whether the arm may be on its way by this procedure
        self._left = list(self._way)
        self._since = None  # when the arm was sent to the first posture that is left, or came there
        self._is_there = False
        self._sum, self._count = np.zeros(len(SQUISH_NM)), 0

    def take(self, wanted: bool, uid: str, time_s: float) -> None:
        """Take a client's request to run or to end the procedure, at time_s [s]."""
        if not wanted:
            self.is_enabled = False
        elif not self.is_enabled:
            self.reset()
            self.is_enabled, self.uid = True, uid
        self._last = time_s

    @property
    def is_active(self) -> bool:
        """Whether `update` must be called."""
        return self.is_enabled or self._moves

    def update(self, time_s: float, robot_enabled: bool, arm: ProcedureArm) -> Order | np.ndarray:
        """Continue the procedure at time_s [s]; arm: `ProcedureArm`. Returns an `Order`, or the next posture (7,) [rad]
        of the arm."""
        if self.is_enabled and time_s - self._last > KEEP_ALIVE_S:
            self.is_enabled, self.timed_out = False, True
        if self.is_enabled and self.complete == NOT_COMPLETE:
            order = self._go_on(time_s, robot_enabled, arm)
            if self.complete == NOT_COMPLETE:
                return order
        order = Order.STOP if self._moves and self.complete != SUCCESS else Order.NOTHING
        self._moves = False
        return order

    def _go_on(self, time_s: float, robot_enabled: bool, arm: ProcedureArm) -> Order | np.ndarray:
        if not robot_enabled:
            return self._fail("the robot is disabled")
        if self._since is None:
            self._since, self._is_there, self._moves = time_s, False, True
            return self._left[0]
        passed = time_s - self._since
        if not self._is_there:
            if np.abs(arm.position - self._left[0]).max() < NEAR_RAD and np.abs(arm.velocity).max() < NEAR_RAD:
                self._since, self._is_there = time_s, True
            elif passed > ARRIVAL_S:
                far = np.abs(arm.position - self._left[0])
                return self._fail("%s is %.2f rad off its posture after %.0f s: something is in the arm's way" % (
                    JOINTS[int(far.argmax())], far.max(), ARRIVAL_S))
            return Order.NOTHING
        if passed > 0.5 * REST_S:
            self._sum += arm.torques
            self._count += 1
        if passed >= REST_S:
            self._left.pop(0)
            self._since = None
            if not self._left:
                self._judge()
        return Order.NOTHING

    def _judge(self) -> None:
        mean = np.abs(self._sum / self._count)
        bound = TOLERANCE * np.array(list(SQUISH_NM.values()))
        wrong = ["%s feels %.1f Nm too much, at most %.1f are allowed" % (name, found, allowed)
                 for name, found, allowed in zip(SQUISH_NM, mean, bound, strict=True) if found > allowed]
        if wrong:
            self._fail(*wrong)
        else:
            self.complete = SUCCESS

    def _fail(self, *reasons: str) -> Order:
        self.complete, self.errors = FAILURE, list(reasons)
        return Order.STOP


class RefusingUpdater:
    """The updater, which refuses every request: there is no source of updates."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.status, self.description = UPDATER_IDLE, "idle"

    def start(self, uuid: str) -> None:
        self.status = UPDATER_INVALID
        self.description = "there is no update '%s': no stick is plugged into a simulated robot" % uuid
