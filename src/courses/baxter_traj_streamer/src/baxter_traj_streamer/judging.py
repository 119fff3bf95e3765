# SPDX-License-Identifier: BSD-3-Clause
"""Checks a goal before anything moves. Free of ROS."""
from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from command_line.options import counted
from joint_trajectory import Trajectory

from .curve import fastest, has_positions_only, interpolate, joined
from .errors import GoalRefused
from .settings import SIDES, arm_joint_names

if TYPE_CHECKING:
    from baxter_traj_streamer.settings import StreamerSettings
    from joint_trajectory.command import Point

KNOWN_JOINTS = tuple(name for side in SIDES for name in arm_joint_names(side))
RIGHT_ARM = tuple(arm_joint_names("right"))
_FIELDS = ("positions", "velocities", "accelerations")
# Samples of the curve between two points that are checked against the limits: shares of the time between them.
_PLACES = np.linspace(0.0, 1.0, 33)
# Rounding must not refuse a curve that just touches a limit.
_ROUNDING = 1e-6


class StreamedJointLimit(NamedTuple):
    """``lower``, ``upper`` [rad], ``velocity`` [rad/s]."""

    lower: float
    upper: float
    velocity: float


class AcceptedPlan(NamedTuple):
    """The plan of an accepted goal: ``joint_names`` (k), ``trajectory`` from time 0 on, ``goal`` (k,) [rad]."""

    joint_names: tuple[str, ...]
    trajectory: Trajectory
    goal: np.ndarray

    @property
    def duration_s(self) -> float:
        return self.trajectory.end_time


def judge(joint_names: Sequence[str], points: Sequence[Point], limits: Mapping[str, StreamedJointLimit],
          measured: Mapping[str, float] | None, settings: StreamerSettings) -> AcceptedPlan:
    """Make a :class:`AcceptedPlan`, or raise :class:`GoalRefused`.

    joint_names: any joints of the arms in any order; empty: the right arm from torso to tool flange.
    points: rows of (time from start [s], positions, velocities, accelerations), the latter two may be empty. With
    positions only and all times 0 the server chooses the times: as short as the limits allow. limits: {joint:
    StreamedJointLimit}; measured: {joint: angle [rad]} or None: the robot may still move, so do not check the start,
    and begin at the first point. settings: :class:`~.settings.StreamerSettings`.
    """
    names = tuple(joint_names) or RIGHT_ARM
    if settings.joints == "right_arm":
        names = RIGHT_ARM
    _judge_names(names)
    if not points:
        raise GoalRefused("empty", "the trajectory has no points; give it at least one")
    if len(points) > settings.max_points:
        raise GoalRefused("too_long", "the trajectory has %s; at most %d are accepted (max_points)" % (
            counted(len(points), "point"), settings.max_points), value=len(points), limit=settings.max_points)
    for index, point in enumerate(points):
        _judge_numbers(index, point, names)
    times = np.array([point[0] for point in points], dtype=float)
    positions_only = has_positions_only(points)
    timeless = positions_only and settings.interpolation != "linear" and not times.any()
    if not timeless:
        _judge_times(times, settings)
    positions = np.array([point[1] for point in points], dtype=float)
    start = _start(names, positions[0], limits, measured)
    bounds = _bounds(names, limits, start, settings.limit_slack)
    if settings.check_limits:
        _judge_positions(positions, names, bounds)
    at_once = times[0] == 0.0
    near = bool((np.abs(positions[0] - start) <= settings.start_tolerance).all())
    if at_once and not near and not timeless and settings.start == "refuse":
        _refuse_start(positions[0], start, names, settings.start_tolerance)
    if timeless or (positions_only and settings.interpolation == "time_optimal"):
        # A first point at the robot's position means the start; another one is a target.
        rest = points[1:] if near and at_once and len(points) > 1 else points
        trajectory = fastest(start, rest, *_pace(names, bounds, settings))
        if trajectory.end_time > settings.max_duration_s:
            raise GoalRefused("too_long", "the trajectory lasts %.9g s at best; it may last %g s (max_duration_s)" % (
                trajectory.end_time, settings.max_duration_s), value=trajectory.end_time, limit=settings.max_duration_s)
        return AcceptedPlan(names, trajectory, positions[-1])
    curve = functools.partial(interpolate, times, points, interpolation=settings.interpolation)
    lead_in = None
    if settings.start == "jump":
        trajectory = curve(start=None)
    elif at_once and not near:
        # "blend": to the first point at planning pace, and on from there.
        trajectory = curve(start=positions[0])
        velocity, acceleration = _pace(names, bounds, settings)
        lead_in = fastest(start, points[:1], velocity * settings.speed_scale_factor, acceleration)
    else:
        trajectory = curve(start=start)
    if settings.check_limits:
        _judge_curve(trajectory, names, bounds, first_point=1 if at_once else 0)
    return AcceptedPlan(names, joined(lead_in, trajectory) if lead_in else trajectory, positions[-1])


def _pace(names: tuple[str, ...], bounds: np.ndarray, settings: StreamerSettings) -> tuple[np.ndarray, np.ndarray]:
    """Velocities [rad/s] and accelerations [rad/s^2] (k,) for trajectories whose times the server chooses."""
    velocity, acceleration = ([table[name.rpartition("_")[2]] for name in names]
                              for table in (settings.max_velocity, settings.max_acceleration))
    return np.minimum(velocity, bounds[2]), np.array(acceleration)


def _judge_names(names: tuple[str, ...]) -> None:
    for index, name in enumerate(names):
        if name not in KNOWN_JOINTS:
            raise GoalRefused("joints", "joint_names has %r, which is not an arm joint; they are %s and the same of "
                              "the left arm" % (name, ", ".join(arm_joint_names("right"))), joint=name)
        if name in names[:index]:
            raise GoalRefused("joints", "joint_names has %s more than once" % name, joint=name)


def _judge_numbers(index: int, point: Point, names: tuple[str, ...]) -> None:
    if not math.isfinite(point[0]):
        raise GoalRefused("number", "point %d: time_from_start is %r, not a finite number" % (index, point[0]), index,
                          value=point[0])
    for field, values in zip(_FIELDS, point[1:], strict=True):
        if len(values) != len(names) and (len(values) or field == "positions"):
            raise GoalRefused("size", "point %d has %d %s, expected %d, one for each of %s" % (
                index, len(values), field, len(names), ", ".join(names)), index, value=len(values), limit=len(names))
        for name, value in zip(names, values):  # noqa: B905 (the values may be left out)
            if not math.isfinite(value):
                raise GoalRefused("number", "point %d, %s: %s has %r, not a finite number" % (
                    index, name, field, value), index, name, value)


def _judge_times(times: np.ndarray, settings: StreamerSettings) -> None:
    if times[0] < 0.0:
        raise GoalRefused("time", "point 0 is due at %.9g s; times from start begin at 0" % times[0], 0, None, times[0],
                          0.0)
    backwards = np.flatnonzero(np.diff(times) <= 0.0)
    if len(backwards):
        index = int(backwards[0]) + 1
        raise GoalRefused("time", "time_from_start must increase: point %d is due at %.9g s, the one before at %.9g s"
                          % (index, times[index], times[index - 1]), index, None, times[index], times[index - 1])
    if times[-1] == 0.0:
        raise GoalRefused("time", "point 0 is the only one and is due at 0 s; give it a time_from_start above 0", 0,
                          None, 0.0, 0.0)
    if times[-1] > settings.max_duration_s:
        index = int(np.argmax(times > settings.max_duration_s))
        raise GoalRefused("too_long", "point %d is due at %.9g s; a trajectory may last %g s (max_duration_s)" % (
            index, times[index], settings.max_duration_s), index, None, times[index], settings.max_duration_s)


def _start(names: tuple[str, ...], first: np.ndarray, limits: Mapping[str, StreamedJointLimit],
           measured: Mapping[str, float] | None) -> np.ndarray:
    """(k,) [rad]: the robot's position, or, if that is unknown, the position within the limits nearest to ``first``."""
    for name in names:
        if name not in limits:
            raise GoalRefused("joints", "the robot's description gives no limits for %s" % name, joint=name)
        if measured is not None and name not in measured:
            raise GoalRefused("joints", "the robot does not report %s; it reports %s" % (
                name, ", ".join(sorted(measured)) or "nothing yet"), joint=name)
    if measured is not None:
        return np.array([measured[name] for name in names])
    return np.clip(first, [limits[name].lower for name in names], [limits[name].upper for name in names])


def _bounds(names: tuple[str, ...], limits: Mapping[str, StreamedJointLimit], start: np.ndarray,
            slack: float) -> np.ndarray:
    """(3, k): lower, upper, velocity; a joint that is beyond its limit may stay there, but not go farther."""
    table = np.array([limits[name] for name in names]).T
    table[0] = np.minimum(table[0], start) - slack
    table[1] = np.maximum(table[1], start) + slack
    return table


def _judge_positions(positions: np.ndarray, names: tuple[str, ...], bounds: np.ndarray) -> None:
    beyond = np.argwhere((positions < bounds[0]) | (positions > bounds[1]))
    if len(beyond):
        index, joint = (int(i) for i in beyond[0])
        _refuse_position("point %d" % index, index, names[joint], positions[index, joint], bounds[:, joint])


def _refuse_position(where: str, index: int, name: str, value: float, bounds: np.ndarray) -> None:
    limit = bounds[0] if value < bounds[0] else bounds[1]
    raise GoalRefused("limit", "%s, %s: %.6f rad is beyond its limit of %.6f rad" % (where, name, value, limit), index,
                      name, float(value), float(limit))


def _refuse_start(first: np.ndarray, start: np.ndarray, names: tuple[str, ...], tolerance: float) -> None:
    joint = int(np.argmax(np.abs(first - start)))
    raise GoalRefused("start", "point 0, %s: %.6f rad at once, but the robot is at %.6f rad, and at most %g rad "
                      "between them are accepted (start_tolerance); begin where the robot is, or give point 0 a "
                      "time_from_start" % (names[joint], first[joint], start[joint], tolerance), 0, names[joint],
                      float(first[joint]), tolerance)


def _judge_curve(trajectory: Trajectory, names: tuple[str, ...], bounds: np.ndarray, first_point: int) -> None:
    """Raise GoalRefused if the curve between the points, (pieces, samples, joints), is too fast or leaves the
    limits."""
    duration = np.diff(trajectory.starts)
    coefficients = trajectory.coefficients[:-1]
    powers = np.arange(6)
    s = duration[:, None, None] * _PLACES[:, None]
    position = np.einsum("mpi,mik->mpk", s ** powers, coefficients)
    slope = np.einsum("mpi,mik->mpk", s ** powers[:-1], coefficients[:, 1:] * powers[1:, None])
    fast = np.argwhere(np.abs(slope) > bounds[2] * (1.0 + _ROUNDING))
    if len(fast):
        piece, _, joint = (int(i) for i in fast[0])
        index = piece + first_point
        value, limit = float(np.abs(slope[piece, :, joint]).max()), float(bounds[2, joint])
        raise GoalRefused("velocity", "on the way to point %d, %s: %.6f rad/s is beyond its limit of %.6f rad/s" % (
            index, names[joint], value, limit), index, names[joint], value, limit)
    beyond = np.argwhere((position < bounds[0] - _ROUNDING) | (position > bounds[1] + _ROUNDING))
    if len(beyond):
        piece, place, joint = (int(i) for i in beyond[0])
        index = piece + first_point
        _refuse_position("on the way to point %d" % index, index, names[joint], position[piece, place, joint],
                         bounds[:, joint])
