# SPDX-License-Identifier: BSD-3-Clause
"""Constraints of goals and paths."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from geometry_msgs.msg import Pose, Quaternion
from moveit_msgs.msg import OrientationConstraint

from command_line.options import counted
from motion_planning.constraints import (
    ConstraintSet,
    JointTarget,
    OrientationTarget,
    PositionTarget,
    VisibilityTarget,
)
from motion_planning.scene import like
from moveit_ros_move_group.convert.geometry import MessageError, matrix_of, mesh_shape_of, shape_of

if TYPE_CHECKING:
    from moveit_msgs.msg import Constraints, JointConstraint, PositionConstraint, VisibilityConstraint

    from motion_planning.scene import Scene
    from moveit_ros_move_group.convert.scene_in import SceneReader

M = TypeVar("M")
T = TypeVar("T")
# Least and greatest number of corners of a cone of sight; least radius of a target [m].
_MIN_SIDES, _MAX_SIDES, _NO_RADIUS = 3, 100, 1e-12
# The quaternion of an orientation may be off by this much, as in MoveIt.
_ROUNDED = 1e-3


def constraint_set_of(message: Constraints, scene: Scene, reader: SceneReader,
                      remarks: list[str]) -> ConstraintSet | None:
    """Return the ConstraintSet of a Constraints message, None for one without any constraint.

    What MoveIt leaves out or changes with a warning is so here; ``remarks`` (list) gets the sentences. Frames are
    looked up in ``scene`` as it is now, by ``reader`` (SceneReader). Raises PlanningError for unknown frames, and for
    numbers that are not finite.
    """
    def targets(constraints: Iterable[M], convert: Callable[[M, Scene, SceneReader, list[str]], T]) -> tuple[T, ...]:
        found = []
        for one in constraints:
            try:
                found.append(convert(one, scene, reader, remarks))
            except _LeftOut as reason:
                remarks.append("%s; the constraint is left out" % reason)
        return tuple(found)

    found = ConstraintSet(
        message.name, targets(message.joint_constraints, _joint), targets(message.position_constraints, _position),
        targets(message.orientation_constraints, _orientation), targets(message.visibility_constraints, _visibility))
    return found if len(found) else None


class _LeftOut(Exception):
    """A constraint that says nothing; the text tells why."""


def _weight(message: JointConstraint | PositionConstraint | OrientationConstraint | VisibilityConstraint) -> float:
    # A weight that was not filled in counts as 1, as in MoveIt.
    return message.weight if message.weight > 0.0 else 1.0


def _joint(message: JointConstraint, scene: Scene, reader: SceneReader, remarks: list[str]) -> JointTarget:
    """Of a joint that mimics another: what it means for that one. MoveIt's clients name both."""
    model = scene.model
    joint, multiplier, offset = model.mimics.get(message.joint_name, (message.joint_name, 1.0, 0.0))
    if joint not in model.index:
        raise _LeftOut("a constraint names joint '%s', which is unknown or cannot be moved%s"
                       % (message.joint_name, like(message.joint_name, model.variables)))
    above, below = message.tolerance_above, message.tolerance_below
    if above < 0.0 or below < 0.0:
        raise _LeftOut("tolerances of joint '%s' are +%g and -%g, expected 0 or more"
                       % (message.joint_name, above, below))
    if multiplier == 0.0:
        raise _LeftOut("joint '%s' always stands at %g" % (message.joint_name, offset))
    if multiplier < 0.0:
        above, below = below, above
    position, above, below = (message.position - offset) / multiplier, above / abs(multiplier), below / abs(multiplier)
    low, high = model.bounds[model.index[joint]]
    if not model.continuous[model.index[joint]] and math.isfinite(position):
        limit = low if position + above < low else high if position - below > high else position
        if limit != position:
            remarks.append("joint '%s' is to be at %g, beyond its limit %g, which is taken instead"
                           % (joint, position, limit))
            position, above, below = limit, above if limit == high else 0.0, below if limit == low else 0.0
    return JointTarget(joint, position, above, below, _weight(message))


def _link(message: PositionConstraint | OrientationConstraint, scene: Scene) -> str:
    name = message.link_name
    if not (name in scene.model.link_index or name and scene.has_frame(name)):
        raise _LeftOut("a constraint is on link '%s', which is neither a link nor attached%s"
                       % (name, like(name, scene.model.links)))
    return name


def _position(message: PositionConstraint, scene: Scene, reader: SceneReader, remarks: list[str]) -> PositionTarget:
    link, frame = _link(message, scene), reader.frame(scene, message.header.frame_id)
    region, offset = message.constraint_region, message.target_point_offset
    what = "the region of link '%s'" % link
    shapes = []
    primitives = [partial(shape_of, one) for one in region.primitives]
    meshes = [partial(mesh_shape_of, one) for one in region.meshes]
    for kind, made, poses in (("shape", primitives, region.primitive_poses), ("mesh", meshes, region.mesh_poses)):
        for number, make in enumerate(made):
            if number >= len(poses):
                remarks.append("%s %d of %s has no pose and is left out" % (kind, number + 1, what))
                continue
            try:
                shape = make()
            except MessageError as error:
                remarks.append("%s %d of %s is left out: %s" % (kind, number + 1, what, error))
                continue
            shapes.append((shape, frame @ matrix_of(poses[number], what)))
    if not shapes:
        raise _LeftOut("the position of link '%s' has no region: give it a shape and a pose" % link)
    return PositionTarget(link, tuple(shapes), np.array((offset.x, offset.y, offset.z)), weight=_weight(message))


def _orientation(message: OrientationConstraint, scene: Scene, reader: SceneReader,
                 remarks: list[str]) -> OrientationTarget:
    link, frame = _link(message, scene), reader.frame(scene, message.header.frame_id)
    turn = message.orientation
    length = math.sqrt(turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2)
    if abs(length - 1.0) > _ROUNDED:
        remarks.append("the orientation of link '%s' has a quaternion (x y z w) %g %g %g %g of length %.3g instead of "
                       "1; no turn is taken instead" % (link, turn.x, turn.y, turn.z, turn.w, length))
        turn = Quaternion(0.0, 0.0, 0.0, 1.0)
    rotation = matrix_of(Pose(orientation=turn), "the orientation of link '%s'" % link)
    x, y, z = tolerances = [message.absolute_x_axis_tolerance, message.absolute_y_axis_tolerance,
                            message.absolute_z_axis_tolerance]
    if min(tolerances) < 0.0:
        remarks.append("tolerances of the orientation of link '%s' are %s; they are taken without their sign"
                       % (link, tolerances))
    kinds = OrientationConstraint.XYZ_EULER_ANGLES, OrientationConstraint.ROTATION_VECTOR
    if message.parameterization not in kinds:
        remarks.append("the parameterization %d of the orientation of link '%s' is unknown; angles about x, y and z "
                       "are taken" % (message.parameterization, link))
    return OrientationTarget(link, (frame @ rotation)[:3, :3], (abs(x), abs(y), abs(z)),
                             rotation_vector=message.parameterization == OrientationConstraint.ROTATION_VECTOR,
                             weight=_weight(message))


def _visibility(message: VisibilityConstraint, scene: Scene, reader: SceneReader,
                remarks: list[str]) -> VisibilityTarget:
    target, sensor = message.target_pose, message.sensor_pose
    if abs(message.target_radius) <= _NO_RADIUS:
        raise _LeftOut("a visibility constraint has a target without radius")
    if message.cone_sides < _MIN_SIDES:
        remarks.append("a cone of sight has %s; %d are taken" % (counted(message.cone_sides, "side"), _MIN_SIDES))
    seen = reader.frame(scene, target.header.frame_id) @ matrix_of(target.pose, "the visibility's target")
    # The sensor moves with the robot: its frame is looked up in each state.
    return VisibilityTarget(abs(message.target_radius), seen, matrix_of(sensor.pose, "the visibility's sensor"),
                            sensor_frame=sensor.header.frame_id.lstrip("/"),
                            cone_sides=min(max(_MIN_SIDES, message.cone_sides), _MAX_SIDES),
                            view_axis=message.sensor_view_direction, max_view_angle=message.max_view_angle,
                            max_range_angle=message.max_range_angle, weight=_weight(message))
