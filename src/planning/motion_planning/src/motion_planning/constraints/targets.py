# SPDX-License-Identifier: BSD-3-Clause
"""Single constraints. ``frame`` is the name of a frame of the scene, "" the planning frame."""
from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.constraints import regions
from motion_planning.errors import PlanningError
from motion_planning.scene import Scene, TriangleMesh, WorldObject
from motion_planning.shapes import read_only
from urdf_model.transforms import inverse, matrix_from_quaternion

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.constraints.regions import Volume
    from motion_planning.exact import Contact, ExactChecker
    from motion_planning.model import PlanningModel, State

#: Margin of comparisons with a tolerance, for rounding errors [rad, m].
_ROUNDING = 1e-9
_AXES = ("z", "y", "x")  # the sensor's viewing axis, by number


class ConstraintError(PlanningError):
    """An invalid constraint: unknown names, invalid tolerances or numbers."""


class Evaluation(NamedTuple):
    """Whether a constraint holds, the distance from its middle (weighted, in its unit), and the reason if it does not
    hold, else ""."""

    satisfied: bool
    distance: float
    sentence: str


@dataclass(frozen=True)
class JointTarget:
    """A joint between position - below and position + above [rad or m]."""

    joint: str
    position: float
    above: float = 1e-4
    below: float = 1e-4
    weight: float = 1.0

    def __post_init__(self) -> None:
        _finite("joint '%s'" % self.joint, self.position, self.above, self.below, self.weight)
        if self.above < 0.0 or self.below < 0.0:
            raise ConstraintError("tolerances of joint '%s' are +%g and -%g; expected 0 or more"
                                  % (self.joint, self.above, self.below))

    def evaluate(self, context: StateInScene) -> Evaluation:
        index = context.variable(self.joint)
        value = float(context.state.q[index])
        off = value - self.position
        if context.model.continuous[index]:
            off = math.remainder(off, 2.0 * math.pi)
        kept = -self.below - _ROUNDING <= off <= self.above + _ROUNDING
        return Evaluation(kept, self.weight * abs(off), "" if kept else
                          "joint '%s' is at %.4f; expected %.4f to %.4f"
                          % (self.joint, value, self.position - self.below, self.position + self.above))

    def resolved(self, scene: Scene) -> JointTarget:
        return self


@dataclass(frozen=True, eq=False)
class PositionTarget:
    """A point of a link inside one of some regions. offset (3,): the point in the link's frame [m].

    regions: ((shape, pose (4, 4) in ``frame``), ...); shapes with a volume: Box, Sphere, Cylinder, Cone, and
    TriangleMesh, which means its convex hull.
    """

    link: str
    regions: tuple[tuple[Volume, np.ndarray], ...]
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    frame: str = ""
    weight: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "offset", read_only(self.offset))
        object.__setattr__(self, "regions", tuple((shape, read_only(pose)) for shape, pose in self.regions))
        _finite("the position of link '%s'" % self.link, self.offset, self.weight, *(pose for _, pose in self.regions))
        if not self.regions:
            raise ConstraintError("the position of link '%s' has no region" % self.link)
        for shape, _ in self.regions:
            if not regions.has_inside(shape):
                raise ConstraintError("the position of link '%s' has a %s as region, which has no volume"
                                      % (self.link, type(shape).__name__))

    def evaluate(self, context: StateInScene) -> Evaluation:
        link, frame = context.link_pose(self.link), context.frame(self.frame)
        point = link[:3, :3] @ self.offset + link[:3, 3]
        distances, inside = [], False
        for shape, pose in self.regions:
            middle = frame @ pose
            distances.append(float(np.linalg.norm(point - middle[:3, 3])))
            inside |= regions.holds(shape, inverse(middle) @ np.append(point, 1.0))
        return Evaluation(inside, self.weight * min(distances), "" if inside else
                          "link '%s' is at %.4f %.4f %.4f, %.4f m from the middle of its region and outside of it"
                          % (self.link, *point, min(distances)))

    def resolved(self, scene: Scene) -> PositionTarget:
        frame = _frame(scene, self.frame)
        link, inside = holder(scene, self.link)
        placed = tuple((shape, frame @ pose) for shape, pose in self.regions)
        return replace(self, link=link, offset=inside[:3, :3] @ self.offset + inside[:3, 3], regions=placed, frame="")


@dataclass(frozen=True, eq=False)
class OrientationTarget:
    """A link turned as ``rotation`` (3, 3), or quaternion (x, y, z, w), in ``frame``, within ``tolerances`` (3,) [rad].

    They bound the angles about x, y and z, or the rotation vector's parts (``rotation_vector``), of the rotation from
    the target to the actual orientation. With pi or more an axis is free.
    """

    link: str
    rotation: np.ndarray
    tolerances: tuple[float, float, float] = (1e-3, 1e-3, 1e-3)
    frame: str = ""
    rotation_vector: bool = False
    weight: float = 1.0
    # The constraint's axes, in the link (3, 3): not the link's own if the constraint is on an attached object.
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        try:
            rotation = np.asarray(self.rotation, dtype=np.float64)
            rotation = matrix_from_quaternion(rotation) if rotation.shape == (4,) else rotation
            _finite("the orientation of link '%s'" % self.link, rotation, self.weight, *self.tolerances)
        except ValueError as error:
            raise ConstraintError("the orientation of link '%s' is none: %s" % (self.link, error)) from None
        if rotation.shape != (3, 3) or abs(np.linalg.det(rotation) - 1.0) > 1e-3:
            raise ConstraintError("the orientation of link '%s' is not a rotation" % self.link)
        if len(self.tolerances) != 3 or min(self.tolerances) < 0.0:
            raise ConstraintError("tolerances of the orientation of link '%s' are %s; expected three of 0 or more"
                                  % (self.link, list(self.tolerances)))
        object.__setattr__(self, "rotation", read_only(rotation))

    def evaluate(self, context: StateInScene) -> Evaluation:
        wanted = context.frame(self.frame)[:3, :3] @ self.rotation
        turn = wanted.T @ context.link_pose(self.link)[:3, :3] @ self.axes
        angles = self.angles(turn)
        kept = all(abs(angle) <= allowed + _ROUNDING for angle, allowed in zip(angles, self.tolerances, strict=True))
        return Evaluation(kept, self.weight * float(np.abs(angles).sum()), "" if kept else
                          "link '%s' is turned by %.4f %.4f %.4f rad (x, y, z) from its target; allowed %g %g %g"
                          % (self.link, *angles, *self.tolerances))

    def angles(self, turn: np.ndarray) -> np.ndarray:
        """Return the angles (3,) of a rotation (3, 3) that the tolerances bound; of equivalent ones, those that fit
        best."""
        if self.rotation_vector:
            return regions.rotation_vector(turn)
        y = math.asin(min(1.0, max(-1.0, turn[0, 2])))
        x, z = math.atan2(-turn[1, 2], turn[2, 2]), math.atan2(-turn[0, 1], turn[0, 0])
        flipped = (math.remainder(x + math.pi, 2.0 * math.pi), math.remainder(math.pi - y, 2.0 * math.pi),
                   math.remainder(z + math.pi, 2.0 * math.pi))
        return min((np.array((x, y, z)), np.array(flipped)), key=lambda angles: max(
            abs(angle) - allowed for angle, allowed in zip(angles, self.tolerances, strict=True)))

    def resolved(self, scene: Scene) -> OrientationTarget:
        link, inside = holder(scene, self.link)
        rotation = _frame(scene, self.frame)[:3, :3] @ self.rotation
        return replace(self, link=link, rotation=rotation, frame="", axes=inside[:3, :3] @ self.axes)


@dataclass(frozen=True, eq=False)
class VisibilityTarget:
    """A disc that a sensor sees, with no link of the robot in between.

    target_pose (4, 4) in ``target_frame``: the disc lies in its x-y plane; target_radius [m]. sensor_pose (4, 4) in
    ``sensor_frame``; view_axis: 0, 1, 2 for a sensor that looks along its z, y, x. max_view_angle [rad]: between the
    sensor's axis and the disc's axis (its z turned round); max_range_angle: between the sensor's axis and the line to
    the disc; 0: not checked. cone_sides: number of corners of the disc.
    """

    target_radius: float
    target_pose: np.ndarray
    sensor_pose: np.ndarray
    target_frame: str = ""
    sensor_frame: str = ""
    cone_sides: int = 8
    view_axis: int = 0
    max_view_angle: float = 0.0
    max_range_angle: float = 0.0
    weight: float = 1.0
    # Links that may be in the line of sight: of the sensor and of the target.
    may_touch: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for name in ("target_pose", "sensor_pose"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        _finite("a visibility", self.target_radius, self.target_pose, self.sensor_pose, self.max_view_angle,
                self.max_range_angle, self.weight)
        if self.view_axis not in (0, 1, 2) or self.cone_sides < 3 or self.target_radius < 0.0:
            raise ConstraintError("a visibility needs a view axis of 0, 1 or 2, three or more sides and a radius of 0 "
                                  "or more, got %s, %s and %s" % (self.view_axis, self.cone_sides, self.target_radius))
        object.__setattr__(self, "may_touch", (*self.may_touch, self.target_frame, self.sensor_frame))

    def evaluate(self, context: StateInScene) -> Evaluation:
        target = context.frame(self.target_frame) @ self.target_pose
        sensor = context.frame(self.sensor_frame) @ self.sensor_pose
        axis, line = sensor[:3, 2 - self.view_axis], target[:3, 3] - sensor[:3, 3]
        reach = float(np.linalg.norm(line))
        if reach < 1e-9:
            return Evaluation(False, 0.0, "the sensor is at the target's position")
        for limit, other, what in ((self.max_view_angle, -target[:3, 2], "the target is turned away from the sensor"),
                                   (self.max_range_angle, line / reach, "the target is off the sensor's axis")):
            angle = math.acos(min(1.0, max(-1.0, float(axis @ other))))
            if limit > 0.0 and angle > limit + _ROUNDING:
                return Evaluation(False, self.weight * (angle - limit), "%s by %.4f rad; at most %.4f are allowed"
                                  % (what, angle, limit))
        if self.target_radius > 0.0 and context.exact is not None:
            for contact in self._in_the_way(context, context.exact, sensor, target):
                if contact.a not in self.may_touch:
                    return Evaluation(False, self.weight * contact.depth, "'%s' is between the sensor and the "
                                      "target" % contact.a)
        return Evaluation(True, 0.0, "")

    def _in_the_way(self, context: StateInScene, exact: ExactChecker, sensor: np.ndarray,
                    target: np.ndarray) -> list[Contact]:
        turns = np.linspace(0.0, 2.0 * math.pi, self.cone_sides, endpoint=False)
        rim = np.stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=1) * self.target_radius
        rim = rim @ target[:3, :3].T + target[:3, 3]
        count = self.cone_sides
        sides = [(0, 1 + k, 1 + (k + 1) % count) for k in range(count)]
        disc = [(count + 1, 1 + (k + 1) % count, 1 + k) for k in range(count)]
        cone = TriangleMesh(np.vstack([sensor[:3, 3], rim, target[:3, 3]]), np.array(sides + disc))
        alone = Scene(context.model, context.state).with_object(
            WorldObject("line of sight", np.eye(4), ((cone, np.eye(4)),)))
        return [one for one in exact.contacts(alone) if one.b == "line of sight"]

    def resolved(self, scene: Scene) -> VisibilityTarget:
        return self  # one of the two moves with the robot, otherwise the constraint could not be influenced


class StateInScene:
    """A state of a robot in a scene, with the frames of both looked up once."""

    def __init__(self, model: PlanningModel, state: State, scene: Scene, exact: ExactChecker | None = None) -> None:
        self.model, self.state, self.exact = model, state, exact
        self._scene = scene.with_state(state)
        self._frames = None

    def variable(self, joint: str) -> int:
        if joint not in self.model.index:
            raise ConstraintError("a constraint names joint '%s', which is unknown or cannot be moved"
                                  % joint)
        return self.model.index[joint]

    def link_pose(self, link: str) -> np.ndarray:
        if link in self.model.link_index:
            if self._frames is None:
                self._frames = self.model.frames(self.state.q, self.state.base)
            return self._frames[self.model.link_index[link]]
        return _frame(self._scene, link)

    def frame(self, name: str) -> np.ndarray:
        return _frame(self._scene, name)


def _frame(scene: Scene, name: str) -> np.ndarray:
    if not name:
        return np.eye(4)
    try:
        return scene.frame(name)
    except PlanningError as error:
        raise ConstraintError("a constraint names a frame: %s" % error) from None


def holder(scene: Scene, name: str) -> tuple[str, np.ndarray]:
    """Return (link, pose (4, 4) in it) of a link, of an attached object, or of an object's subframe. Raises
    ConstraintError for other names."""
    if name in scene.model.link_index:
        return name, np.eye(4)
    owner = name if name in scene.state.attached else name.rpartition("/")[0]
    if owner not in scene.state.attached:
        raise ConstraintError("a constraint is on link '%s', which is neither a link nor attached" % name)
    link = scene.state.attached[owner].link
    return link, inverse(scene.frame(link)) @ _frame(scene, name)


def _finite(what: str, *numbers: ArrayLike) -> None:
    if not all(np.isfinite(number).all() for number in numbers):
        raise ConstraintError("%s has a number that is not finite" % what)
