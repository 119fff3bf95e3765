# SPDX-License-Identifier: BSD-3-Clause
"""Experts: programs that do the tasks of gym_baxter, action by action, with knowledge of the whole state.

An expert is a feedback law. Its hands move towards places that follow from the present state, so it recovers from
disturbances, and what it does can be learned from observations. Hands are steered by osc_pose; places are in `base`.
"""
from __future__ import annotations

import math
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from baxter_lab import Arm
from baxter_model import SIDES
from gym_baxter.controls import OSC_POSITION_M, OSC_ROTATION_RAD
from gym_baxter.core import Core
from gym_baxter.one_arm import PickPlace, Reach
from gym_baxter.tasks import TABLE_TOP_M, Task
from gym_baxter.two_arms import TwoArmHandover, TwoArmLift

#: The control that experts steer by.
CONTROL = "osc_pose"
OPEN, CLOSED = -1.0, 1.0
_STAYS = np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, OPEN))
#: So far from where it begins, a hand has the full speed [m]; there it has the least. Without this its shoulder, which
#: gains 0.5 rad/s in an action, would fall behind and then overshoot, and what is observed does not say which.
_EASY_M = 0.06
#: A hand is at its place when it is so near [m], [rad]; fingers that have begun to close go on in so many times that,
#: and have begun when they are not as far open as this [%].
_NEAR_M, _NEAR_RAD, _STILL_NEAR, _BEGUN = 0.008, 0.06, 2.5, 90.0
#: Hands come down, and carry, at this height above the place [m], and from this distance beside it they sink.
_ABOVE_M, _BESIDE_M, _SLOPE = 0.10, 0.012, 2.0
#: A thing is carried the more freely the higher it is, from the first to the second height over its place [m].
_FREE_M = (0.01, 0.06)
#: Direction from the meeting of two hands to the robot.
_AWAY = np.array((-1.0, 0.0, 0.0))


TaskT = TypeVar("TaskT", bound=Task[Any])


class ExpertPace(NamedTuple):
    """gain: share of the remaining way of one action; drives follow with some lag, and more overshoots; speed_m,
    speed_rad: most of one action [m], [rad]; least_m: the same where a hand begins [m]; steps: actions that are enough,
    a try with more has failed; noise: share of the disturbance for learning that is corrected as far as the whole one
    is with ideal drives."""

    gain: float
    speed_m: float
    speed_rad: float
    least_m: float
    steps: int
    noise: float

    def eased(self, way: float) -> float:
        """Most of one action [m] of a hand that is `way` [m] from where it began."""
        return min(self.least_m + (self.speed_m - self.least_m) * max(way, 0.0) / _EASY_M, self.speed_m)


#: With ideal drives.
_PACE = ExpertPace(0.25, 0.016, 0.06, 0.004, 300, 1.0)
#: With the effect `lag`, shoulders are 0.2 s behind. At the gain above they swing, and a hand that comes down at that
#: speed goes 6 cm on: it hits things, and the robot's collision detection stops the arm.
_GENTLE = ExpertPace(0.1, 0.008, 0.03, 0.002, 400, 0.4)


class HandGoal(NamedTuple):
    """Where a hand should go: place (3,) [m], rotation (3, 3), its gripper -1 (opens) to 1 (closes); share of the
    full speed."""

    place: np.ndarray
    rotation: np.ndarray
    grip: float
    speed: float = 1.0


def down(yaw: float) -> np.ndarray:
    """(3, 3) of a hand that points straight down; its fingers close along (sin yaw, -cos yaw)."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]])


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """(3,) axis times angle [rad] of a rotation (3, 3), angle at most pi."""
    axis = 0.5 * np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                           rotation[1, 0] - rotation[0, 1]])
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, 0.5 * (float(np.trace(rotation)) - 1.0))
    if sine > 1e-6:
        return axis * (angle / sine)
    if angle < 1.0:
        return axis
    # Half a turn: the axis is the greatest column of (R + 1) / 2.
    both = 0.5 * (rotation + np.eye(3))
    column = both[:, int(np.argmax(np.diag(both)))]
    return angle * column / np.linalg.norm(column)


def _clipped(vector, most):
    length = float(np.linalg.norm(vector))
    return vector if length <= most else vector * (most / length)


def _funnel(beside):
    """Height above a place [m] of a hand that is so far beside it [m]: down at the place, up elsewhere."""
    return min(max(_SLOPE * (beside - _BESIDE_M), 0.0), _ABOVE_M)


def _risen(height):
    """How freely a thing is carried at a height [m], 0 to 1."""
    return _share(height, *_FREE_M)


def _share(value: float, low: float, high: float) -> float:
    """How far a value is from the first to the second of two others, 0 to 1; they may fall."""
    return min(max((value - low) / (high - low), 0.0), 1.0)


def _between(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """(3,) a direction between two others, which are not opposite."""
    found = one + share * (other - one)
    return found / np.linalg.norm(found)


def _nearest(yaw, to, period):
    """The angle nearest to `to` that differs from `yaw` by multiples of `period`."""
    return yaw - period * round((yaw - to) / period)


def _yaw(pose):
    return math.atan2(pose[1, 0], pose[0, 0])


class Expert(Generic[TaskT]):
    """Base of all experts. core: of the task KIND, by CONTROL. `act` returns the action for the present state.
    Attribute `pace`: how fast it moves."""

    KIND: type[TaskT]
    MOVED: tuple[str, ...] = SIDES  # arms that have something to do; the others get no action, and no disturbance

    def __init__(self, core: Core):
        if core.choices.control != CONTROL:
            raise ValueError("experts steer by control %r; found %r" % (CONTROL, core.choices.control))
        if not isinstance(core.task, self.KIND):
            raise ValueError("%s does %s; found %r" % (type(self).__name__, self.KIND.NAME, core.task.NAME))
        self.core, self.task, self.arms = core, core.task, core.lab.robot.arms
        self.pace = _GENTLE if "lag" in core.lab.robot.simulated.chosen else _PACE

    def begin(self) -> None:
        """An episode begins; `act` follows."""
        self._rest = {side: arm.pose for side, arm in self.arms.items()}

    def act(self) -> np.ndarray:
        """(14,) the action for the present state."""
        hands = self.hands()
        return np.concatenate([self._action(self.arms[side], hands[side]) if side in hands else _STAYS
                               for side in self.core.sides])

    def hands(self) -> dict[str, HandGoal]:
        """{side: where it should go now} of the arms in MOVED."""
        raise NotImplementedError

    def _action(self, arm: Arm, hand: HandGoal):
        pose = arm.pose
        most = self.pace.eased(float(np.linalg.norm(pose[:3, 3] - self._rest[arm.side][:3, 3])))
        gain = self.pace.gain
        shift = _clipped(gain * (hand.place - pose[:3, 3]), hand.speed * most)
        turn = _clipped(gain * rotation_vector(hand.rotation @ pose[:3, :3].T), hand.speed * self.pace.speed_rad)
        return np.array([*(shift / OSC_POSITION_M), *(turn / OSC_ROTATION_RAD), hand.grip])

    def _is_at(self, side, place, rotation, times=1.0):
        pose = self.arms[side].pose
        return bool(np.linalg.norm(place - pose[:3, 3]) < times * _NEAR_M
                    and np.linalg.norm(rotation_vector(rotation @ pose[:3, :3].T)) < times * _NEAR_RAD)

    def _approach(self, side, place, rotation):
        """A hand that comes to its place along its own axis, and closes there."""
        height = _funnel(self._beside(side, place, rotation))
        closes = self._is_at(side, place, rotation, self._patience(side))
        return HandGoal(place - height * rotation[:, 2], rotation, CLOSED if closes else OPEN)

    def _beside(self, side, place, rotation):
        """How far a hand is beside its way to a place [m]; turns count as well."""
        pose, axis = self.arms[side].pose, rotation[:, 2]
        off = pose[:3, 3] - place
        return (float(np.linalg.norm(off - axis * (axis @ off)))
                + 0.05 * float(np.linalg.norm(rotation_vector(rotation @ pose[:3, :3].T))))

    def _patience(self, *sides):
        """How much further from their places hands may be once fingers of one of them have begun to close."""
        return _STILL_NEAR if any(self.arms[side].gripper.position < _BEGUN for side in sides) else 1.0


class ReachExpert(Expert[Reach]):
    """The hand goes to the point."""

    KIND, MOVED = Reach, ("left",)

    def hands(self):
        """The left hand at the goal."""
        return {"left": HandGoal(self.task.goal, self._rest["left"][:3, :3], OPEN)}


class PickPlaceExpert(Expert[PickPlace]):
    """Down onto the block, and over the mark."""

    KIND, MOVED = PickPlace, ("left",)
    #: It lets go of the block this high above the mark [m].
    _LOW_M = 0.015

    def hands(self):
        """The left hand at the block, or with it at the mark."""
        block, goal = self.task.block.pose, self.task.goal
        rotation = down(_nearest(_yaw(block), math.pi, math.pi / 2.0))
        place, hand = block[:3, 3], self.arms["left"].pose[:3, 3]
        left = float(np.linalg.norm(goal[:2] - place[:2]))
        holds = self.arms["left"].gripper.holds
        near, low = (_BESIDE_M, self._LOW_M) if holds else (self.task.WITHIN_M, 2.0 * self._LOW_M)
        if left < near and place[2] - goal[2] < low:
            return {"left": HandGoal(hand, self.arms["left"].pose[:3, :3], OPEN)}  # it stands there
        if not holds:
            return {"left": self._approach("left", place, rotation)}
        # What it holds hangs as it was taken.
        height, wanted = place[2] - goal[2], _funnel(left)
        to = hand + (goal - place) + (0.0, 0.0, wanted)
        if height < wanted:  # first up
            to[:2] = hand[:2] + _risen(height) * (to[:2] - hand[:2])
        return {"left": HandGoal(to, rotation, CLOSED, self.pace.eased(height) / self.pace.speed_m)}


class TwoArmLiftExpert(Expert[TwoArmLift]):
    """Both hands come down at their handles and close together, then both go up. One that closed before the other would
    pull the pot about."""

    KIND = TwoArmLift
    _HIGH_M = 0.16

    def hands(self):
        """Both hands."""
        handles = self.task._handles()
        rotation = down(_nearest(_yaw(self.task.pot.pose), 0.0, math.pi))
        if all(self.arms[side].gripper.holds for side in SIDES):
            raised = self._HIGH_M - self.task._lift()
            return {side: HandGoal(self.arms[side].pose[:3, 3] + (0.0, 0.0, raised), rotation, CLOSED, 0.5)
                    for side in SIDES}
        height = _funnel(max(self._beside(side, place, rotation) for side, place in handles.items()))
        times = self._patience(*SIDES)
        closes = all(self._is_at(side, place, rotation, times) for side, place in handles.items())
        return {side: HandGoal(place - height * rotation[:, 2], rotation, CLOSED if closes else OPEN)
                for side, place in handles.items()}


class TwoArmHandoverExpert(Expert[TwoArmHandover]):
    """The right hand brings the hammer in front of the robot, and the left one, which goes where its end will be, takes
    it there.

    All that is wanted follows from what policies see. A gripper says that it holds something a while after its fingers
    have stopped, and that is not observed; so a hand has the handle when its fingers are as far apart as the handle is
    thick.
    """

    KIND = TwoArmHandover
    #: Along the hammer: where the right hand takes it, and the left one [m].
    _RIGHT_M, _LEFT_M = 0.05, -0.07
    #: Where the right hand holds it for the left one, and how far hands lean outwards then.
    _MEETING, _TILT_RAD = np.array((0.62, -0.02, 0.10)), math.radians(45.0)
    #: The left hand waits so far from where it will take the hammer, and goes there as the right one arrives: from the
    #: first to the second distance from the meeting [m].
    _WAITING_M, _ARRIVING_M = 0.17, (0.10, 0.025)
    #: Fingers on the handle are less open than this [%], and the hand is so near its place on the handle [m].
    _ON_HANDLE, _ON_HANDLE_M = {"left": 53.0, "right": 74.0}, {"left": 0.015, "right": 0.03}
    _BACK_M = 0.05  # a hand that lets go withdraws by this at a time, as far as its fingers are open

    def hands(self):
        """Both hands."""
        hammer = self.task.hammer.pose
        # The hammer's axis, or its reverse, as the hands' first axis: the one that is nearer.
        sense = 1.0 if self.arms["right"].pose[:3, 0] @ hammer[:3, 0] > 0.0 else -1.0
        axis = sense * hammer[:3, 0]
        grasp = {side: hammer[:3, 3] + along * hammer[:3, 0]
                 for side, along in zip(SIDES, (self._LEFT_M, self._RIGHT_M), strict=True)}
        height = float(hammer[2, 3]) - TABLE_TOP_M - 0.5 * self.task.HEAD_M[2]
        if self._has("left", grasp["left"], height):
            return {"left": self._stays("left", CLOSED), "right": self._withdraws("right")}
        if not self._has("right", grasp["right"], height):
            return {"left": self._waits(self._MEETING, _AWAY),
                    "right": self._approach("right", grasp["right"], down(math.atan2(axis[1], axis[0])))}
        right, risen = self.arms["right"].pose, _share(height, 0.02, self.task.LIFTED_M)
        rotation = self._leaning("right", _between(axis, _AWAY, risen), risen)
        to = right[:3, 3] + risen * (self._MEETING - right[:3, 3]) + (1.0 - risen) * np.array((0.0, 0.0, 0.1))
        found = {"right": HandGoal(to, rotation, CLOSED, self.pace.eased(height) / self.pace.speed_m)}
        # Where the left hand will take it, and, as the right one arrives, where that is now.
        off = float(np.linalg.norm(self._MEETING - right[:3, 3])) + 0.1 * float(np.linalg.norm(
            rotation_vector(self._leaning("right", _AWAY) @ right[:3, :3].T)))
        arrived = _share(off, *self._ARRIVING_M)
        ready = self._waits(self._MEETING + sense * (self._LEFT_M - self._RIGHT_M) * _AWAY, _AWAY)
        takes = self._approach("left", grasp["left"], self._leaning("left", axis))
        found["left"] = takes._replace(place=ready.place + arrived * (takes.place - ready.place),
                                       rotation=self._leaning("left", _between(_AWAY, axis, arrived)))
        return found

    def _has(self, side: str, place: np.ndarray, height: float) -> bool:
        """Whether a hand has the handle between its fingers; place (3,) [m]: where it takes it; height [m]: of the
        hammer. In the air, fingers that are askew count as well."""
        arm = self.arms[side]
        most = _BEGUN if side == "right" and height > _FREE_M[0] else self._ON_HANDLE[side]
        return bool(arm.gripper.position < most
                    and np.linalg.norm(place - arm.pose[:3, 3]) < self._ON_HANDLE_M[side])

    def _stays(self, side: str, grip: float) -> HandGoal:
        return HandGoal(self.arms[side].pose[:3, 3], self.arms[side].pose[:3, :3], grip)

    def _withdraws(self, side: str) -> HandGoal:
        pose, opened = self.arms[side].pose, _share(self.arms[side].gripper.position, self._ON_HANDLE[side], 100.0)
        return HandGoal(pose[:3, 3] - opened * self._BACK_M * pose[:3, 2], pose[:3, :3], OPEN)

    def _waits(self, place: np.ndarray, axis: np.ndarray) -> HandGoal:
        """The left hand before a place (3,) [m]."""
        rotation = self._leaning("left", axis)
        return HandGoal(place - self._WAITING_M * rotation[:, 2], rotation, OPEN)

    def _leaning(self, side: str, axis: np.ndarray, share: float = 1.0) -> np.ndarray:
        """(3, 3) of a hand with its first axis along `axis` (3,), which points down and, by `share` of the whole tilt,
        to the other side."""
        tilt = share * self._TILT_RAD
        pointing = np.array((0.0, (1.0 if side == "right" else -1.0) * math.sin(tilt), -math.cos(tilt)))
        pointing -= axis * (axis @ pointing)
        pointing /= np.linalg.norm(pointing)
        return np.column_stack([axis, np.cross(pointing, axis), pointing])


EXPERTS: dict[str, type[Expert[Any]]] = {expert.KIND.NAME: expert for expert in (
    ReachExpert, PickPlaceExpert, TwoArmLiftExpert, TwoArmHandoverExpert)}
