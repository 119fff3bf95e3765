# SPDX-License-Identifier: BSD-3-Clause
"""Constraints of goals and paths."""
from geometry_msgs.msg import Pose
from moveit_msgs.msg import OrientationConstraint

from motion_planning.constraints import (
    ConstraintSet,
    JointTarget,
    OrientationTarget,
    PositionTarget,
    VisibilityTarget,
)
from moveit_ros_move_group.convert.geometry import MessageError, matrix_of, mesh_shape_of, shape_of

# Greatest number of corners of a cone of sight.
_MOST_SIDES = 100


def constraint_set_of(message, scene, reader):
    """Return the ConstraintSet of a Constraints message, None for one without any constraint.

    Frames are looked up in ``scene`` as it is now, by ``reader`` (SceneReader). Raises PlanningError, also for unknown
    joints and links.
    """
    for one in (*message.position_constraints, *message.orientation_constraints):
        if not (one.link_name in scene.model.link_index or scene.has_frame(one.link_name)):
            raise MessageError("a constraint is on link '%s', which is neither a link nor attached" % one.link_name)
    found = ConstraintSet(
        message.name, [_joint(one, scene.model) for one in message.joint_constraints],
        [_position(one, scene, reader) for one in message.position_constraints],
        [_orientation(one, scene, reader) for one in message.orientation_constraints],
        [_visibility(one, scene, reader) for one in message.visibility_constraints])
    return found if len(found) else None


def _weight(message):
    # A weight that was not filled in counts as 1, as in MoveIt.
    return message.weight if message.weight > 0.0 else 1.0


def _joint(message, model):
    """Of a joint that mimics another: what it means for that one. MoveIt's clients name both."""
    joint, multiplier, offset = model.mimics.get(message.joint_name, (message.joint_name, 1.0, 0.0))
    if joint not in model.index:
        raise MessageError("a constraint names joint '%s', which is unknown or cannot be moved"
                           % message.joint_name)
    if multiplier == 0.0:
        raise MessageError("joint '%s' always stands at %g, whatever a constraint says" % (message.joint_name, offset))
    above, below = message.tolerance_above, message.tolerance_below
    if multiplier < 0.0:
        above, below = below, above
    return JointTarget(joint, (message.position - offset) / multiplier, above / abs(multiplier),
                       below / abs(multiplier), _weight(message))


def _position(message, scene, reader):
    frame = reader.frame(scene, message.header.frame_id)
    region, offset = message.constraint_region, message.target_point_offset
    what = "the region of link '%s'" % message.link_name
    if len(region.primitives) != len(region.primitive_poses) or len(region.meshes) != len(region.mesh_poses):
        raise MessageError("%s has %d shapes but %d poses" % (
            what, len(region.primitives) + len(region.meshes), len(region.primitive_poses) + len(region.mesh_poses)))
    shapes = [(shape_of(shape), frame @ matrix_of(pose, what))
              for shape, pose in zip(region.primitives, region.primitive_poses, strict=True)]
    shapes += [(mesh_shape_of(mesh), frame @ matrix_of(pose, what))
               for mesh, pose in zip(region.meshes, region.mesh_poses, strict=True)]
    return PositionTarget(message.link_name, shapes, (offset.x, offset.y, offset.z), weight=_weight(message))


def _orientation(message, scene, reader):
    frame = reader.frame(scene, message.header.frame_id)
    turn = matrix_of(Pose(orientation=message.orientation), "the orientation of link '%s'" % message.link_name)
    tolerances = (message.absolute_x_axis_tolerance, message.absolute_y_axis_tolerance,
                  message.absolute_z_axis_tolerance)
    return OrientationTarget(message.link_name, (frame @ turn)[:3, :3], tolerances,
                             rotation_vector=message.parameterization == OrientationConstraint.ROTATION_VECTOR,
                             weight=_weight(message))


def _visibility(message, scene, reader):
    target, sensor = message.target_pose, message.sensor_pose
    seen = reader.frame(scene, target.header.frame_id) @ matrix_of(target.pose, "the visibility's target")
    # The sensor moves with the robot: its frame is looked up in each state.
    return VisibilityTarget(message.target_radius, seen, matrix_of(sensor.pose, "the visibility's sensor"),
                            sensor_frame=sensor.header.frame_id.lstrip("/"),
                            cone_sides=min(max(3, message.cone_sides), _MOST_SIDES),
                            view_axis=message.sensor_view_direction, max_view_angle=message.max_view_angle,
                            max_range_angle=message.max_range_angle, weight=_weight(message))
