# SPDX-License-Identifier: BSD-3-Clause
"""Single commands: point to point, line, arc."""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.cartesian import CartesianError, Line, LineFollower
from motion_planning.errors import PlanningError
from motion_planning.industrial.curves import NoCircle, Spline, Straight, arc_about, arc_through
from motion_planning.industrial.goals import goal_of
from motion_planning.industrial.profile import WINDOW_S, Profile
from motion_planning.pipeline import Code, Plan, PlanningFailure, PlanQuery
from motion_planning.timing import Timed, within_limits
from urdf_model.transforms import rotation_angle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from motion_planning.industrial.curves import Arc
    from motion_planning.industrial.goals import Goal
    from motion_planning.industrial.limits import CartesianLimits
    from motion_planning.model import Group
    from motion_planning.pipeline import Tools
    from motion_planning.scene import Scene

    #: Velocity, acceleration and deceleration of the fraction.
    Limits = tuple[float, float, float]

PLANNERS = ("PTP", "LIN", "CIRC")

# Steps of inverse kinematics along a path [m], [rad]; and their least number.
_STEP_M, _STEP_RAD, _FEWEST_STEPS = 0.01, 0.05, 8
_MAX_STEPS = 3000
# Allowed distance of the link from its path, also between the trajectory's points [m], [rad].
DEVIATION_M, DEVIATION_RAD = 5e-4, 5e-3
# Where it is checked, between two points of a trajectory.
_BETWEEN = np.array([0.2, 0.5, 0.8])
# Greatest number of halvings until it holds, and greatest number of points before.
_HALVINGS, _MAX_POINTS = 6, 2000
# Greatest factor by which lines and arcs are slowed down for the joints' limits, and margin of each slowing.
_MAX_STRETCH, _MORE = 20.0, 1.002
# A command with smaller motions of all joints [rad or m], or of its link [m or rad], is already done.
_NOTHING = 1e-6
# Greatest distance of checked states [rad or m, in any joint], and number of them between two calls of ``stop``.
_RESOLUTION, _AT_ONCE = 0.02, 200


@dataclass(frozen=True, eq=False)
class Auxiliary:
    """The auxiliary point of an arc. kind: "center" or "interim"; point (3,) in the planning frame."""

    kind: str
    point: np.ndarray


@dataclass(frozen=True, eq=False)
class IndustrialCommand:
    """query: PlanQuery with planner_id of :data:`PLANNERS` and exactly one goal; its path constraints do not influence
    the planning, but the trajectory must satisfy them. auxiliary: for CIRC. start_velocities: of the group's joints, if
    known."""

    query: PlanQuery
    auxiliary: Auxiliary | None = None
    start_velocities: Sequence[float] = ()


@dataclass(frozen=True, eq=False)
class IndustrialMotion:
    """A command's path. curve: joints (k,) by the fraction of it; path: poses of the link, None for PTP; follower: of
    the link, None if the group has none; limits (3,): velocity, acceleration and deceleration of the fraction; moves:
    false if start and goal are the same; scene: Scene at the start."""

    command: IndustrialCommand
    scene: Scene
    curve: Straight | Spline
    path: Line | Arc | None
    follower: LineFollower | None
    limits: Limits
    moves: bool = True

    @property
    def link(self) -> str:
        """The link that the follower moves, "" without one."""
        return self.follower.link if self.follower is not None else ""

    @property
    def group(self) -> Group:
        return self.scene.model.groups[self.command.query.group]

    def pose(self, fraction: float) -> np.ndarray:
        """The link's pose (4, 4)."""
        if self.path is not None:
            return self.path.at(fraction)
        if self.follower is None:
            raise PlanningFailure(Code.NO_IK_SOLUTION, "group '%s' is not a chain; no link of it has a pose"
                                  % self.group.name)
        return self.follower.pose_of_link(self.curve.at(np.array([fraction]))[0][0])

    @property
    def end(self) -> np.ndarray:
        """The group's joints (k,) at the goal."""
        return self.curve.at(np.ones(1))[0][0]


def plan(command: IndustrialCommand, tools: Tools, limits: CartesianLimits) -> Plan:
    """Return the pipeline.Plan of a :class:`IndustrialCommand`; tools: pipeline.Tools; limits: CartesianLimits.

    PTP: all joints start and arrive together, each with the same share of its motion at each time. LIN, CIRC: the link
    follows its path within DEVIATION_M and DEVIATION_RAD, with its rotation in step. The speed is a trapezoid; limits
    of joints are respected, and for LIN and CIRC those of the link, too: if a joint is too slow, the whole command is
    slower. Raises PlanningFailure. There is no planning around obstacles: a collision makes the command fail.
    """
    begin = tools.clock()
    way = motion(command, tools, limits)
    timed = in_time(way)[0]
    check(way.scene, command.query, timed, tools)
    return Plan(command.query.scene.state, timed.positions, timed, tools.clock() - begin)


def motion(command: IndustrialCommand, tools: Tools, limits: CartesianLimits) -> IndustrialMotion:
    """Return the :class:`IndustrialMotion` of a command. Raises PlanningFailure."""
    query, model = command.query, command.query.scene.model
    _understand(command)
    group = model.groups[query.group]
    start = query.scene.state.q[group.indices]
    goal = goal_of(query, tools)
    scaling = (query.velocity_scaling, query.acceleration_scaling)
    if goal.q is not None:
        reach = float(np.abs(goal.q - start).max())
        slowest = scaling[0] * model.velocity[group.indices].min(), scaling[1] * model.acceleration[group.indices].min()
        moves = reach > _NOTHING
        speeds = tuple(limit / max(reach, _NOTHING) for limit in (*slowest, slowest[1]))
        follower = LineFollower(model, group, query.scene.state, goal.link, None) if goal.link else None
        return IndustrialMotion(command, query.scene, Straight(start, goal.q), None, follower, speeds, moves)
    follower, end = _follower(query, group, goal)
    path = _path(command, follower.pose_of_link(start), end)
    if path.length < _NOTHING and path.angle < _NOTHING:
        return IndustrialMotion(command, query.scene, Straight(start, start), path, follower, (1.0, 1.0, 1.0), False)
    curve = _followed(path, follower, start, (query.planner_id, tools.stop))
    return IndustrialMotion(command, query.scene, curve, path, follower, limits.along(path.length, path.angle, scaling))


def in_time(way: IndustrialMotion, limits: Limits | None = None, stretch: float = 1.0) -> tuple[Timed, Profile, float]:
    """Return (Timed, Profile, factor by which it takes longer than by its own limits) of a IndustrialMotion.

    limits: velocity, acceleration and deceleration of the fraction, None: the Motion's; stretch: least factor by which
    it takes longer. Raises PlanningFailure if the joints need far longer.
    """
    velocity, acceleration, deceleration = limits or way.limits
    profile = Profile(velocity / stretch, acceleration / stretch**2, deceleration / stretch**2)
    if not way.moves:
        still = way.curve.at(np.zeros(1))[0]
        return Timed(np.zeros(1), still, np.zeros_like(still), np.zeros_like(still)), profile, stretch
    intervals = min(max(2, math.ceil(profile.duration / (0.5 * WINDOW_S))), _MAX_POINTS)
    for _ in range(_HALVINGS + 1):
        timed = _points(way, profile, np.linspace(0.0, profile.duration, intervals + 1))
        if _deviation(way, profile, timed) <= 1.0:
            break
        intervals *= 2
    else:
        raise PlanningFailure(Code.PLANNING_FAILED, "the joints cannot follow the way of link '%s' within %g m; the "
                              "arm is near a singular posture" % (way.link, DEVIATION_M))
    if way.path is None:
        model, indices = way.scene.model, way.group.indices
        return within_limits(timed, model.velocity[indices], model.acceleration[indices]), profile, stretch
    excess = _excess(way, timed)
    if excess <= 1.0:
        return timed, profile, stretch
    if stretch * excess > _MAX_STRETCH:
        raise _too_slow(way, timed, stretch * excess)
    return in_time(way, limits, stretch * excess * _MORE)


def check(scene: Scene, query: PlanQuery, timed: Timed, tools: Tools) -> None:
    """Raise PlanningFailure if a Timed of the query's group exceeds position limits, violates a path constraint, or
    collides in ``scene``."""
    model, group = scene.model, scene.model.groups[query.group]
    states = timed.sampled(timed.spaced(_RESOLUTION))[0]
    low, high = model.bounds[group.indices].T
    low, high = np.minimum(low, states[0]), np.maximum(high, states[0])  # a start slightly beyond is led back
    beyond = np.argwhere(((states < low - 1e-6) | (states > high + 1e-6)) & ~model.continuous[group.indices])
    if len(beyond):
        at, joint = beyond[0]
        raise PlanningFailure(Code.INVALID_MOTION_PLAN, "joint '%s' would reach %.4f; its limits are %.4f and %.4f" % (
            group.joints[joint], states[at, joint], low[joint], high[joint]),
            joints={group.joints[joint]: float(states[at, joint])})
    for first in range(0, len(states), _AT_ONCE):
        _stopped(tools)
        hit = tools.exact.first_blocked(scene, states[first:first + _AT_ONCE], query.group)
        if hit is not None:
            contacts = tools.exact.contacts(scene, scene.state.with_q(states[first + hit], group.indices), query.group)
            raise PlanningFailure(
                Code.INVALID_MOTION_PLAN, "%s; %s does not plan around obstacles: %s" % (
                    "the start is in collision" if first + hit == 0 else "a collision on the way, after %.0f %% of it"
                    % (100.0 * (first + hit) / (len(states) - 1)), query.planner_id,
                    "; ".join(map(str, contacts[:3]))), contacts)
    if query.path_constraints is not None:
        for q in states:
            _stopped(tools)
            violated = next((one.sentence for one in query.path_constraints.evaluate(
                model, scene.state.with_q(q, group.indices), scene) if not one.satisfied), None)
            if violated:
                raise PlanningFailure(Code.INVALID_MOTION_PLAN, "the way violates the path constraints: %s" % violated)


def _understand(command: IndustrialCommand) -> None:
    """Raise PlanningFailure for an incomplete or impossible command."""
    query, model = command.query, command.query.scene.model
    if query.planner_id not in PLANNERS:
        raise PlanningFailure(Code.PLANNING_FAILED, "there is no planner '%s'; expected %s"
                              % (query.planner_id, ", ".join(PLANNERS)))
    if query.group not in model.groups or not model.groups[query.group].joints:
        raise PlanningFailure(Code.INVALID_GROUP_NAME, "robot '%s' has no group '%s' with joints; its groups are %s" % (
            model.name, query.group, ", ".join(model.groups) or "none"))
    for name in ("velocity", "acceleration"):
        scaling = getattr(query, name + "_scaling")
        if not 1e-4 <= scaling <= 1.0:
            raise PlanningFailure(Code.INVALID_MOTION_PLAN, "max_%s_scaling_factor is %g; %s needs 0.0001 to 1"
                                  % (name, scaling, query.planner_id))
    moving = [(joint, speed) for joint, speed in zip(model.groups[query.group].joints, command.start_velocities,
                                                     strict=False) if not abs(speed) <= 1e-6]
    if moving:
        raise PlanningFailure(Code.INVALID_ROBOT_STATE, "the start state has velocity %g at joint '%s'; %s starts at "
                              "rest" % (moving[0][1], moving[0][0], query.planner_id))
    group = model.groups[query.group]
    beyond = model.beyond_limits(query.scene.state.q, query.start_bounds_error, group.indices)
    if beyond:
        raise PlanningFailure(Code.INVALID_ROBOT_STATE, "the start state is out of bounds: joint '%s' is at %.4f, its "
                              "limits are %.4f and %.4f" % beyond[0], joints={beyond[0][0]: beyond[0][1]})


def _follower(query: PlanQuery, group: Group, goal: Goal) -> tuple[LineFollower, np.ndarray]:
    """The LineFollower of the goal's link, and the link's pose at the goal."""
    if goal.link is None or goal.pose is None:
        raise PlanningFailure(Code.NO_IK_SOLUTION, "group '%s' is not a chain; %s needs a link to move: give a pose as "
                              "goal, or another group" % (group.name, query.planner_id))
    try:
        return LineFollower(query.scene.model, group, query.scene.state, goal.link, None), goal.pose
    except CartesianError as error:
        raise PlanningFailure(Code.NO_IK_SOLUTION, str(error)) from None


def _path(command: IndustrialCommand, begin: np.ndarray, end: np.ndarray) -> Line | Arc:
    if command.query.planner_id == "LIN":
        return Line(begin, end)
    auxiliary = command.auxiliary
    if auxiliary is None or auxiliary.kind not in ("center", "interim"):
        raise PlanningFailure(
            Code.INVALID_MOTION_PLAN, "CIRC needs path_constraints with the name 'center' or 'interim'%s, and one "
            "position constraint whose constraint_region.primitive_poses[0] is that point" % (
                ", not '%s'" % auxiliary.kind if auxiliary is not None else ""))
    try:
        arc = arc_about if auxiliary.kind == "center" else arc_through
        return arc(begin, end, np.asarray(auxiliary.point, dtype=float))
    except NoCircle as error:
        raise PlanningFailure(Code.INVALID_MOTION_PLAN, "no circle: %s" % error) from None


def _followed(path: Line | Arc, follower: LineFollower, start: np.ndarray,
              doing: tuple[str, Callable[[], bool]]) -> Spline:
    """The Spline of joints along ``path``; doing: (planner, stop())."""
    planner, stop = doing
    steps = max(_FEWEST_STEPS, math.ceil(path.length / _STEP_M), math.ceil(path.angle / _STEP_RAD))
    if steps > _MAX_STEPS:
        raise PlanningFailure(Code.INVALID_GOAL_CONSTRAINTS, "the way is %.1f m long; the most is %.1f m"
                              % (path.length, _MAX_STEPS * _STEP_M))
    points = [start]
    for step in range(steps):
        if stop():
            raise PlanningFailure(Code.PREEMPTED, "planning was stopped")
        reason = follower.advance(path, step / steps, (step + 1) / steps, points)
        if reason is not None:
            raise PlanningFailure(Code.NO_IK_SOLUTION, "%s ends after %.0f %% of its way: %s"
                                  % (planner, 100.0 * step / steps, reason))
    return Spline([0.0, *follower.fractions], points)


def _points(way: IndustrialMotion, profile: Profile, times: np.ndarray) -> Timed:
    fraction, speed, rate = profile.at(times)
    value, slope, bend = way.curve.at(np.clip(fraction, 0.0, 1.0))
    speed, rate = speed[:, None], rate[:, None]
    return Timed(times, value, slope * speed, bend * speed**2 + slope * rate)


def _deviation(way: IndustrialMotion, profile: Profile, timed: Timed) -> float:
    """The link's distance from its path between the points of a trajectory, as a multiple of the allowed distance."""
    if way.path is None or way.follower is None:
        return 0.0
    gaps = np.diff(timed.times)[:, None] * _BETWEEN
    times = (timed.times[:-1, None] + gaps).ravel()
    worst = 0.0
    for q, fraction in zip(timed.sampled(times)[0], profile.at(times)[0], strict=True):
        wanted, met = way.path.at(min(max(fraction, 0.0), 1.0)), way.follower.pose_of_link(q)
        worst = max(worst, np.linalg.norm(wanted[:3, 3] - met[:3, 3]) / DEVIATION_M,
                    rotation_angle(wanted[:3, :3].T @ met[:3, :3]) / DEVIATION_RAD)
    return float(worst)


def _excess(way: IndustrialMotion, timed: Timed) -> float:
    """The factor by which a trajectory must take longer to respect the joints' limits, 1 or less if it does."""
    model, indices = way.scene.model, way.group.indices
    speeds, accelerations = timed.peaks()
    return max((speeds / model.velocity[indices]).max(), math.sqrt((accelerations / model.acceleration[indices]).max()))


def _too_slow(way: IndustrialMotion, timed: Timed, slower: float) -> PlanningFailure:
    """The PlanningFailure of a path that a joint can follow only ``slower`` times as slowly."""
    speeds = timed.peaks()[0] / way.scene.model.velocity[way.group.indices]
    at, joint = np.unravel_index(speeds.argmax(), speeds.shape)
    return PlanningFailure(
        Code.PLANNING_FAILED, "joint '%s' cannot keep up with link '%s' after %.0f %% of the way: the command would "
        "have to be %.0f times slower than asked for; lower its scaling factors, or keep away from singular postures"
        % (way.group.joints[joint], way.link, 100.0 * timed.times[at] / timed.duration, slower))


def _stopped(tools: Tools) -> None:
    if tools.stop():
        raise PlanningFailure(Code.PREEMPTED, "planning was stopped")


def failing(error: PlanningError, number: int, count: int) -> PlanningError:
    """The PlanningFailure of a command of a sequence; ``number`` from 1 on."""
    text = "command %d of %d: %s" % (number, count, error)
    if isinstance(error, PlanningFailure):
        return PlanningFailure(error.code, text, error.contacts, error.joints)
    return PlanningFailure(Code.FAILURE, text) if isinstance(error, PlanningError) else error
