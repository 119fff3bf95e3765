# SPDX-License-Identifier: BSD-3-Clause
"""An arm of a robot is moved, and what it was told and did is recorded. Free of ROS: the robot is a `RobotArm`.

All times are those of the robot's joint states, so no clocks are compared: a command's time is that of the joint states
it answers. What messages take to and fro is the delay that the fit finds.
"""
from __future__ import annotations

from collections import deque
from contextlib import suppress
from typing import NamedTuple, Protocol

import numpy as np

from arm_kinematics import Chain
from baxter_model import BASE_FRAME, JOINTS, SIDES, joint_names, tip_of
from baxter_model.description import arm_radius
from baxter_model.readiness import UNFOLD
from baxter_sim_hardware import effects
from baxter_sim_hardware.arms import avoidance
from baxter_sim_hardware.arms.guarding import guards_of
from baxter_sim_hardware.arms.safety import Distances
from urdf_model import Robot

from .arm_body import Array
from .errors import SysidError
from .excitation import PERIOD_S
from .recording import ArmRecording

#: The way to the first set-point: its speed in the fastest joint [rad/s], and how near [rad] the arm must be there
#: within so long [s].
APPROACH_RAD_S, THERE_RAD, ARRIVE_S = 0.25, 0.05, 10.0
#: An arm rests that has stayed within STILL_RAD [rad], some counts of a sensor with noise, for STILL_S [s].
STILL_RAD, STILL_S = 0.005, 1.0
#: Raw set-points expire after 0.2 s without a new one; a stream with a gap like this one [s] is no stream. Those of
#: position mode do not expire: its gap is what the arm may have left of its way.
LARGEST_GAP_S, LARGEST_APPROACH_GAP_S = 0.15, 1.0
_MARGIN_RAD = 0.05  # from the joints' limits
_CHECKED_RAD = 0.05  # a way is looked at in steps like this one


class Stopped(SysidError):
    """The motion ended before its time, and the arm was told to stay where it was."""


class ArmReading(NamedTuple):
    """time_s: of the robot's joint states; position (7,) [rad]; trouble: why the arm must not go on, else ""."""

    time_s: float
    position: Array
    trouble: str


class RobotArm(Protocol):
    """One arm of a robot that is at hand."""

    def next(self) -> ArmReading:
        """Wait for the next joint states. Raises SysidError if none come."""
        ...

    def command(self, position: Array, raw: bool) -> None:
        """Send set-points (7,) [rad]: raw ones, or those of position mode, which avoids collisions."""


class Space:
    """Postures of an arm that come too near to body, head or the other arm, by the field of collision avoidance.

    robot: its description. Raises SysidError for one that is no Baxter.
    """

    def __init__(self, robot: Robot) -> None:
        missing = [name for side in SIDES for name in joint_names(side) if name not in robot.joints]
        if missing:
            raise SysidError("the description has no joint %s; it must be Baxter's" % missing[0])
        self.chains = {side: Chain.from_robot(robot, base=BASE_FRAME, tip=tip_of(side)) for side in SIDES}
        links = {side: [robot.joints[name].child for name in joint_names(side)] for side in SIDES}
        self._guards = guards_of(robot)
        self._distances = Distances(effects.read(effects.physical_robot()), links, arm_radius(robot))

    def near(self, side: str, postures: dict[str, Array]) -> list[str]:
        """Names of the links that one arm is too near to; postures: {side: (7,)} of both arms."""
        frames = {each: self.chains[each].joint_frames(np.clip(posture, self.chains[each].lower,
                                                               self.chains[each].upper))
                  for each, posture in postures.items()}
        still = np.zeros(len(postures[side]))
        found = avoidance.field(self._guards, *frames[side], still)
        found = self._distances.around(found, side, [frames], still)
        found = self._distances.between(found, side, [frames], still)
        return sorted({*found.near, *found.other, *found.body})

    def require_free(self, side: str, way: Array, other: Array) -> None:
        """Raise SysidError if a way (rows, 7) of one arm leaves the joints' limits, or comes too near to something.

        other: (7,) where the other arm is.
        """
        chain = self.chains[side]
        over = np.maximum(way - (chain.upper - _MARGIN_RAD), (chain.lower + _MARGIN_RAD) - way).max(axis=0)
        if over.max() > 0.0:
            worst = int(np.argmax(over))
            raise SysidError("the motion takes %s to within %.2f rad of its limits, %.2f and %.2f rad" % (
                joint_names(side)[worst], max(_MARGIN_RAD - over[worst], 0.0), chain.lower[worst], chain.upper[worst]))
        away, = set(SIDES) - {side}
        last = None
        for posture in way:
            if last is None or np.abs(posture - last).max() > _CHECKED_RAD:
                last = posture
                near = self.near(side, {side: posture, away: other})
                if near:
                    raise SysidError("on the way the %s arm comes too near to %s. Move both arms apart and away from "
                                     "the body first: %s" % (side, ", ".join(near), UNFOLD))


def straight(start: Array, goal: Array) -> Array:
    """(rows, 7) [rad] set-points every PERIOD_S straight in joint space, as fast as APPROACH_RAD_S."""
    count = max(2, 1 + int(np.ceil(np.abs(goal - start).max() / (APPROACH_RAD_S * PERIOD_S))))
    return np.linspace(start, goal, count)


def record(arm: RobotArm, way: Array, points: Array, side: str) -> ArmRecording:
    """Move an arm along `way` in position mode, then along raw set-points `points`, both (rows, 7) every PERIOD_S.

    What it does along `points` is returned. Whatever ends it, Ctrl-C too, the arm is told to stay where it is. Raises
    Stopped with the reason.
    """
    try:
        seen = _follow(arm, arm.next(), way, raw=False)[-1][0]
        rows = _follow(arm, _settle(arm, seen, way[-1]), points, raw=True)
    except BaseException:
        _stay(arm)
        raise
    arm.command(points[-1], raw=False)
    return resampled(rows, side)


def _stay(arm: RobotArm) -> None:
    # A robot that says nothing stops by itself: raw set-points expire.
    with suppress(SysidError):
        position = arm.next().position
        if np.isfinite(position).all():
            arm.command(position, raw=False)


def _follow(arm: RobotArm, seen: ArmReading, points: Array, raw: bool) -> list[tuple[ArmReading, Array]]:
    """[(what was seen, the set-points (7,) sent then)], until the last one was sent."""
    begin, rows = seen.time_s, []
    end = PERIOD_S * (len(points) - 1)
    there = PERIOD_S * np.arange(len(points))
    while True:
        _require(seen, rows[-1][0].time_s if rows else begin, LARGEST_GAP_S if raw else LARGEST_APPROACH_GAP_S)
        passed = seen.time_s - begin
        goal = np.array([np.interp(passed, there, joint) for joint in points.T])
        arm.command(goal, raw)
        rows.append((seen, goal))
        if passed >= end:
            return rows
        seen = arm.next()


def _settle(arm: RobotArm, seen: ArmReading, goal: Array) -> ArmReading:
    """Wait until the arm rests at `goal` (7,)."""
    begin, last = seen.time_s, deque([seen])
    while True:
        arm.command(goal, False)
        seen = arm.next()
        _require(seen, last[-1].time_s, LARGEST_APPROACH_GAP_S)
        last.append(seen)
        off = np.abs(seen.position - goal)
        if seen.time_s - last[0].time_s >= STILL_S:
            moved = np.ptp([one.position for one in last], axis=0).max()
            if off.max() < THERE_RAD and moved < STILL_RAD:
                return seen
            last.popleft()
        if seen.time_s - begin > ARRIVE_S:
            raise Stopped("the arm does not come to rest at its start: %s is %.3f rad off. Is something in its way?" % (
                JOINTS[int(np.argmax(off))], off.max()))


def _require(seen: ArmReading, before_s: float, largest_gap_s: float) -> None:
    if seen.trouble:
        raise Stopped(seen.trouble)
    if not -1e-9 <= seen.time_s - before_s <= largest_gap_s:
        raise Stopped("the robot's joint states went from %.3f to %.3f s, and at most %g s may lie between two. Is "
                      "this machine busy with other work, or are there two robots?" % (
                          before_s, seen.time_s, largest_gap_s))


def resampled(rows: list[tuple[ArmReading, Array]], side: str) -> ArmRecording:
    """The recording in equal steps; rows: of what was seen, and what was sent then. Joint states of the same time count
    once."""
    times = np.array([seen.time_s for seen, _ in rows])
    keep = np.concatenate([[True], np.diff(times) > 1e-6])
    times = times[keep] - times[0]
    grid = PERIOD_S * np.arange(int(times[-1] / PERIOD_S) + 1)
    sensed, sent = (np.array(each)[keep] for each in zip(*((seen.position, goal) for seen, goal in rows), strict=True))
    arrays = [np.stack([np.interp(grid, times, joint) for joint in values.T], axis=1) for values in (sent, sensed)]
    return ArmRecording(grid, {side: arrays[0]}, {side: arrays[1]})
