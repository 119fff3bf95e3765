# SPDX-License-Identifier: BSD-3-Clause
"""Joint paths along which a link moves in straight lines."""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from arm_kinematics import Budget, Chain, InvalidTarget, KinematicsError, NoSolution, Target, solve
from motion_planning.errors import PlanningError
from urdf_model.transforms import axis_rotation, inverse, rigid, rotation_angle

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.model import Group, PlanningModel, State

# Allowed distance of the link from its line between two steps [m], [rad]; a step is halved if it is exceeded.
LINE_TOLERANCE_M = 1e-3
LINE_TOLERANCE_RAD = 1e-2
# Greatest number of halvings of a step; a remaining deviation from the line is a jump of the joints.
_HALVINGS = 8
# Greatest rotation of the link in a step, per metre of its greatest translation.
_RADIANS_PER_METRE = 3.5
# Greatest distance of joint values between two calls of ``accept`` [rad or m, in any joint].
_RESOLUTION = 0.05
_MAX_STEPS = 20000
# Least number of points for a meaningful mean step, which the jump threshold multiplies.
_FEWEST_FOR_JUMPS = 10
# First a descent from the previous step; then more starts, of which the solution nearest to the previous step counts.
_NEXT = Budget(candidates=1, max_starts=1)
_THOROUGH = Budget(candidates=16)


class CartesianError(PlanningError):
    """A request for which no path can be computed; the text gives the reason."""


class Steps(NamedTuple):
    """How a line is divided into steps, and which of its points are valid.

    max_step: greatest distance of two points [m]; rotations in proportion; a step is halved if the link would leave its
    line in between. jump_threshold: 0, or the greatest ratio of a step to the mean step, in joint space; checked from
    ten points on. accept(q (k,)): None, or the reason why q is not valid; also called along the steps. stop(): true
    ends the search.
    """

    max_step: float
    jump_threshold: float = 0.0
    accept: Callable[[np.ndarray], str | None] | None = None
    stop: Callable[[], bool] | None = None


class CartesianPath(NamedTuple):
    """joints (m, k): the group's joints, the start first; fraction 0 to 1 of the waypoints' legs; reason: why the
    path ends before the last waypoint, or None."""

    joints: np.ndarray
    fraction: float
    reason: str | None


def cartesian_path(model: PlanningModel, group: str, start: State, link: str, waypoints: Sequence[ArrayLike],
                   steps: Steps) -> CartesianPath:
    """Return the :class:`CartesianPath` that moves ``link`` in straight lines through ``waypoints``.

    model: PlanningModel; group: name; start: State. waypoints: poses (4, 4) of the link in the planning frame.
    steps: :class:`Steps`. Each leg of the path has the same share of ``fraction``.

    Raises CartesianError for a max_step that is not above 0, waypoints that are not poses, a link that the group does
    not move alone, and too many steps.
    """
    max_step, jump_threshold = steps.max_step, steps.jump_threshold
    if not (math.isfinite(max_step) and max_step > 0.0):
        raise CartesianError("the greatest step must be above 0, got %g m" % max_step)
    if not (math.isfinite(jump_threshold) and jump_threshold >= 0.0):
        raise CartesianError("the jump threshold must be 0 or more, got %g" % jump_threshold)
    follower = LineFollower(model, model.groups[group], start, link, steps.accept)
    waypoints = [follower.pose(i, waypoint) for i, waypoint in enumerate(waypoints)]
    here = follower.pose_of_link(follower.q)
    pieces = [_pieces(a, b) for a, b in zip([here, *waypoints], waypoints, strict=False)]
    if len(pieces) > _MAX_STEPS or not sum(pieces) / _MAX_STEPS <= max_step:
        raise CartesianError("%d waypoints over %g m in steps of %g m are too many points, the most is %d; make the "
                             "steps larger" % (len(pieces), sum(pieces), max_step, _MAX_STEPS))
    # The small subtraction keeps 0.3 / 0.1 from being rounded up to four.
    counts = [max(1, math.ceil(piece / max_step - 1e-6)) for piece in pieces]
    points, done, reason = [follower.q], [0.0], None
    for leg, (goal, count) in enumerate(zip(waypoints, counts, strict=True)):
        for step in range(count):
            if steps.stop is not None and steps.stop():
                reason = "stopped"
            else:
                line = Line(here, goal)
                reason = follower.advance(line, step / count, (step + 1) / count, points)
            if reason is not None:
                reason = "%s, on the way to waypoint %d of %d, after %.0f %% of it" % (
                    reason, leg + 1, len(waypoints), 100.0 * step / count)
                break
            done += [(leg + (step + 1) / count) / len(waypoints)] * (len(points) - len(done))
        if reason is not None:
            break
        here = goal
    del points[len(done):]
    path = CartesianPath(np.array(points), done[-1] if waypoints else 1.0, reason)
    return _without_jump(path, done, jump_threshold, model.groups[group].joints)


def _without_jump(path: CartesianPath, done: list[float], threshold: float, names: Sequence[str]) -> CartesianPath:
    """The path up to its first step above the threshold; ``done``: the fraction at each point; names: of the joints."""
    if threshold == 0.0 or len(path.joints) < _FEWEST_FOR_JUMPS:
        return path
    steps = np.diff(path.joints, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    over = np.flatnonzero(lengths > threshold * lengths.mean())
    if not len(over):
        return path
    first = int(over[0])
    most = int(np.abs(steps[first]).argmax())
    reason = "step %d is %.2g times the mean step, above the jump threshold %g; joint '%s' moves most, by %.3f" % (
        first + 1, lengths[first] / lengths.mean(), threshold, names[most], abs(steps[first, most]))
    return CartesianPath(path.joints[:first + 1], done[first], reason)


class Line:
    """Poses (4, 4) from one to another: the position on a line, the rotation about one axis."""

    def __init__(self, begin: np.ndarray, end: np.ndarray) -> None:
        """begin, end (4, 4). length [m], angle [rad]: of the whole line."""
        self._begin, self._shift = begin, end[:3, 3] - begin[:3, 3]
        turn = begin[:3, :3].T @ end[:3, :3]
        self.length, self.angle = float(np.linalg.norm(self._shift)), rotation_angle(turn)
        self._axis = _axis(turn, self.angle)

    def at(self, fraction: float) -> np.ndarray:
        """Return the pose at ``fraction`` of the line, 0 to 1."""
        rotation = self._begin[:3, :3] @ axis_rotation(self._axis, fraction * self.angle)
        return rigid(rotation, self._begin[:3, 3] + fraction * self._shift)


def _axis(rotation: np.ndarray, angle: float) -> np.ndarray:
    if angle < 1e-9:
        return np.array([0.0, 0.0, 1.0])
    if angle < math.pi - 1e-3:
        axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                         rotation[1, 0] - rotation[0, 1]])
    else:
        # Near a half turn the antisymmetric part vanishes; the symmetric one is 2 axis axis^T - 1.
        symmetric = 0.5 * (rotation + rotation.T) + np.eye(3)
        axis = symmetric[:, int(np.diag(symmetric).argmax())]
        skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                         rotation[1, 0] - rotation[0, 1]])
        axis = axis if axis @ skew >= 0.0 else -axis
    return axis / np.linalg.norm(axis)


def _pieces(begin: np.ndarray, end: np.ndarray) -> float:
    """The length that is divided into steps [m]: of the line, or of the rotation in proportion if that is greater."""
    distance = float(np.linalg.norm(end[:3, 3] - begin[:3, 3]))
    angle = rotation_angle(begin[:3, :3].T @ end[:3, :3])
    return max(distance, angle / _RADIANS_PER_METRE)


class Curve(Protocol):
    """A way of a link."""

    def at(self, fraction: float) -> np.ndarray:
        """Return the pose (4, 4) at ``fraction``, 0 to 1."""
        ...


class LineFollower:
    """Follows a line, which is a :class:`Curve`, with the joints of one group that move the link.

    q (k,): the group's present
    values; fractions: of the line, at each appended point.
    """

    def __init__(self, model: PlanningModel, group: Group, start: State, link: str,
                 accept: Callable[[np.ndarray], str | None] | None) -> None:
        """model: PlanningModel; group: Group; start: State; accept: as in :class:`Steps`. Raises CartesianError."""
        self._accept, self.link = accept, link
        self._names = group.joints
        self.fractions: list[float] = []
        self.q = np.array(start.q, dtype=float)[list(group.indices)]
        base, joints = _moving(model, group, link)
        self._chain = Chain.from_robot(model.robot, base, link)
        self._columns = np.array([group.joints.index(joint) for joint in joints])
        self._base = model.frame_of(start.q, base, start.base)
        self._base_inverse = inverse(self._base)

    def pose(self, number: int, waypoint: ArrayLike) -> np.ndarray:
        """The waypoint, checked and made orthonormal. Raises CartesianError."""
        try:
            return Target(waypoint).pose
        except InvalidTarget as error:
            raise CartesianError("waypoint %d is not a pose: %s" % (number + 1, error)) from None

    def pose_of_link(self, q: np.ndarray) -> np.ndarray:
        """Return the pose (4, 4) of the link in the planning frame with the group's joints at ``q`` (k,)."""
        return self._base @ self._chain.fk(q[self._columns])

    def advance(self, line: Curve, begin: float, end: float, points: list[np.ndarray]) -> str | None:
        """Append the points from ``begin`` (excluded) to ``end`` on the line; return None, or the reason of a
        failure."""
        before = self.q
        count = len(points)
        reason = self._advance(line, begin, end, points, _HALVINGS)
        reached = len(points)
        if reason is not None:
            del points[count:]
            del self.fractions[len(self.fractions) - (reached - count):]
            self.q = before
        return reason

    def _advance(self, line: Curve, begin: float, end: float, points: list[np.ndarray], halvings: int) -> str | None:
        goal = line.at(end)
        try:
            q = self.solved(goal, self.q)
        except NoSolution as error:
            return str(error)
        middle = 0.5 * (self.q + q)
        wanted, met = line.at(0.5 * (begin + end)), self.pose_of_link(middle)
        off = np.linalg.norm(met[:3, 3] - wanted[:3, 3])
        turned = rotation_angle(wanted[:3, :3].T @ met[:3, :3])
        if off > LINE_TOLERANCE_M or turned > LINE_TOLERANCE_RAD:
            if halvings == 0:
                most = int(np.abs(q - self.q).argmax())
                return "joint '%s' would have to jump by %.3f, from %.3f to %.3f" % (
                    self._names[most], abs(q - self.q)[most], self.q[most], q[most])
            half = 0.5 * (begin + end)
            return (self._advance(line, begin, half, points, halvings - 1)
                    or self._advance(line, half, end, points, halvings - 1))
        if self._accept is not None:
            pieces = max(1, math.ceil(float(np.abs(q - self.q).max()) / _RESOLUTION))
            for piece in range(1, pieces + 1):
                reason = self._accept(self.q + (q - self.q) * (piece / pieces))
                if reason:
                    return reason
        self.q = q
        points.append(q)
        self.fractions.append(end)
        return None

    def solved(self, pose: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Return the group's joints (k,) near ``near`` (k,) that put the link at ``pose``. Raises NoSolution."""
        target, seed = Target(self._base_inverse @ pose), near[self._columns]
        try:
            found = solve(self._chain, target, seed, budget=_NEXT)
        except NoSolution:
            found = solve(self._chain, target, seed, budget=_THOROUGH)
        q = near.copy()
        q[self._columns] = found.q
        return q


def _moving(model: PlanningModel, group: Group, link: str) -> tuple[str, tuple[str, ...]]:
    """The first link of the chain in which the group's joints move ``link``, and these joints in order. Raises
    CartesianError."""
    if link not in model.robot.links:
        raise CartesianError("the robot has no link '%s'" % link)
    way = model.robot.chain(model.root, link)
    mine = [joint.name in group.joints for joint in way]
    if not any(mine):
        raise CartesianError("no joint of group '%s' moves link '%s'" % (group.name, link))
    first = mine.index(True)
    foreign = [joint.name for joint, owned in zip(way[first:], mine[first:], strict=True)
               if not owned and joint.type != "fixed"]
    if foreign:
        raise CartesianError("link '%s' is moved by joint '%s' too, which is not in group '%s'"
                             % (link, foreign[0], group.name))
    base = way[first].parent
    try:
        joints = Chain.from_robot(model.robot, base, link).joint_names
    except KinematicsError as error:
        raise CartesianError(str(error)) from None
    return base, joints
