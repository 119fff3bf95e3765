# SPDX-License-Identifier: BSD-3-Clause
"""Constraints messages to constraint sets."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from moveit_msgs.msg import (
    BoundingVolume,
    Constraints,
    JointConstraint,
    OrientationConstraint,
    PositionConstraint,
    VisibilityConstraint,
)
from shape_msgs.msg import SolidPrimitive

from motion_planning.errors import PlanningError
from moveit_ros_move_group.convert.constraints import constraint_set_of
from moveit_ros_move_group.convert.geometry import pose_of
from moveit_ros_move_group.convert.scene_in import SceneReader
from urdf_model.transforms import axis_rotation, rigid

READER = SceneReader()
UNIT = Quaternion(0.0, 0.0, 0.0, 1.0)


def position(point, frame="", link="hand", offset=(0.0, 0.0, 0.0), radius=0.01):
    message = PositionConstraint(link_name=link, weight=1.0, target_point_offset=Vector3(*offset),
                                 constraint_region=BoundingVolume(
                                     primitives=[SolidPrimitive(SolidPrimitive.SPHERE, [radius])],
                                     primitive_poses=[Pose(Point(*point), UNIT)]))
    message.header.frame_id = frame
    return message


def broken(scene, **constraints):
    remarks = []
    found = constraint_set_of(Constraints(**constraints), scene, READER, remarks)
    assert not remarks
    return found.broken(scene.model, scene.state, scene)


def understood(scene, **constraints):
    """(ConstraintSet or None, sentences on what was left out or taken otherwise)"""
    remarks = []
    return constraint_set_of(Constraints(**constraints), scene, READER, remarks), remarks


def test_a_joint_that_mimics_another_is_where_that_one_puts_it(scene):
    """Clients name such joints beside those that they follow; at 0.2 the joint that is followed puts it at -0.2."""
    def off(position, above=0.01, below=0.01):
        return broken(scene, joint_constraints=[JointConstraint("balance", position, above, below, 1.0)])

    assert off(-0.2) is None and off(-0.25, above=0.06) is None and off(-0.15, below=0.06) is None
    assert "'reach' is at 0.2000; expected 0.2800 to 0.3200" in off(-0.25)
    assert off(-0.25, below=0.06) and off(-0.15, above=0.06)


def test_nothing_is_none(scene):
    assert understood(scene, name="empty") == (None, [])


def test_joints(scene):
    assert broken(scene, joint_constraints=[JointConstraint("turn", 0.45, 0.1, 0.0, 1.0)]) is None
    assert "'turn' is at 0.5" in broken(scene, joint_constraints=[JointConstraint("turn", 0.45, 0.01, 0.0, 1.0)])


def test_positions_in_frames_and_with_offsets(scene):
    there = scene.frame("hand")[:3, 3]
    assert broken(scene, position_constraints=[position(there)]) is None
    assert "hand" in broken(scene, position_constraints=[position(there + 0.1)])
    assert broken(scene, position_constraints=[position((0.2, 0.0, 0.0), "arm")]) is None
    ahead = (scene.frame("hand") @ (0.3, 0.0, 0.0, 1.0))[:3]
    assert broken(scene, position_constraints=[position(ahead, offset=(0.3, 0.0, 0.0))]) is None


@pytest.mark.parametrize("as_vector", [False, True])
def test_orientations(scene, as_vector):
    turn = scene.frame("hand")[:3, :3] @ axis_rotation((0.0, 0.0, 1.0), 0.2)
    message = OrientationConstraint(link_name="hand", orientation=pose_of(rigid(turn, (0.0, 0.0, 0.0))).orientation,
                                    absolute_x_axis_tolerance=0.1, absolute_y_axis_tolerance=0.1,
                                    absolute_z_axis_tolerance=0.3, parameterization=int(as_vector), weight=1.0)
    assert broken(scene, orientation_constraints=[message]) is None
    message.absolute_z_axis_tolerance = 0.1
    assert "hand" in broken(scene, orientation_constraints=[message])


def test_visibility(scene):
    """The hand looks along its x axis at a disc that faces it."""
    faces = axis_rotation((0.0, 1.0, 0.0), -0.5 * math.pi)  # z of the disc against x of the hand
    target = scene.frame("hand") @ rigid(faces, (1.0, 0.0, 0.0))
    message = VisibilityConstraint(target_radius=0.01, cone_sides=4, max_view_angle=0.2, sensor_view_direction=2,
                                   weight=1.0)
    message.target_pose = PoseStamped(pose=pose_of(target))
    message.sensor_pose.header.frame_id, message.sensor_pose.pose.orientation = "hand", UNIT
    assert broken(scene, visibility_constraints=[message]) is None
    message.target_pose.pose = pose_of(target @ rigid(axis_rotation((1.0, 0.0, 0.0), 1.0), (0.0, 0.0, 0.0)))
    assert "turned away" in broken(scene, visibility_constraints=[message])


def orientation(turn=UNIT, tolerances=(0.1, 0.1, 0.1), link="hand", **fields):
    return OrientationConstraint(link_name=link, orientation=turn, weight=1.0, **fields, **{
        "absolute_%s_axis_tolerance" % axis: tolerance for axis, tolerance in zip("xyz", tolerances, strict=True)})


@pytest.mark.parametrize("constraints, sentence", [
    ({"position_constraints": [position((0.0, 0.0, 0.0), "nowhere")]}, "nowhere"),
    ({"position_constraints": [position((math.nan, 0.0, 0.0))]}, "not finite"),
    ({"joint_constraints": [JointConstraint("turn", math.inf, 0.0, 0.0, 1.0)]}, "not finite"),
    ({"joint_constraints": [JointConstraint("turn", math.nan, 0.0, 0.0, 1.0)]}, "not finite"),
    ({"orientation_constraints": [orientation(Quaternion(math.nan, 0.0, 0.0, 1.0))]}, "not finite"),
])
def test_what_cannot_be_understood_is_told(scene, constraints, sentence):
    with pytest.raises(PlanningError, match=sentence):
        understood(scene, **constraints)


POSELESS = position((0.0, 0.0, 0.0))
POSELESS.constraint_region.primitive_poses = []
NO_SHAPE = position((0.0, 0.0, 0.0))
NO_SHAPE.constraint_region.primitives = [SolidPrimitive(77, [1.0])]


@pytest.mark.parametrize("kind, constraint, named", [
    ("joint", JointConstraint("nose", 0.0, 0.1, 0.1, 1.0), "nose"),
    ("joint", JointConstraint("turn", 0.0, -1.0, 0.1, 1.0), "turn"),
    ("joint", JointConstraint("turn", 0.0, 0.1, -1.0, 1.0), "turn"),
    ("position", position((0.0, 0.0, 0.0), link="nose"), "nose"),
    ("position", position((0.0, 0.0, 0.0), link=""), "''"),
    ("position", PositionConstraint(link_name="hand"), "hand"),
    ("position", POSELESS, "no pose"),
    ("position", NO_SHAPE, "77"),
    ("orientation", orientation(link="nose"), "nose"),
    ("orientation", orientation(link=""), "''"),
    ("visibility", VisibilityConstraint(), "radius"),
])
def test_what_says_nothing_is_left_out_with_a_remark_as_in_moveit(scene, kind, constraint, named):
    found, remarks = understood(scene, **{"%s_constraints" % kind: [constraint]})
    assert found is None and named in " ".join(remarks)
    good = JointConstraint("reach", 0.2, 0.1, 0.1, 1.0)
    fields = {"joint_constraints": [good]}
    fields.setdefault("%s_constraints" % kind, []).append(constraint)
    found, remarks = understood(scene, **fields)
    assert len(found) == 1 and named in " ".join(remarks)
    assert found.broken(scene.model, scene.state, scene) is None


def test_one_shape_of_a_region_is_enough(scene):
    there = scene.frame("hand")[:3, 3]
    both = position(there)
    both.constraint_region.primitives.append(SolidPrimitive(SolidPrimitive.BOX, [1.0]))
    both.constraint_region.primitive_poses.append(both.constraint_region.primitive_poses[0])
    found, remarks = understood(scene, position_constraints=[both])
    assert len(found.positions[0].regions) == 1 and len(remarks) == 1


def test_what_moveit_takes_otherwise_is_taken_so_with_a_remark(scene):
    found, remarks = understood(scene, orientation_constraints=[
        orientation(Quaternion(0.0, 0.0, 2.0, 0.0)), orientation(tolerances=(-0.2, 0.1, 0.1)),
        orientation(parameterization=9)])
    assert len(remarks) == 3 and "length 2" in remarks[0]
    assert np.allclose(found.orientations[0].rotation, np.eye(3))
    assert found.orientations[1].tolerances == (0.2, 0.1, 0.1) and not found.orientations[2].rotation_vector


@pytest.mark.parametrize("position, taken", [(5.0, 2.0), (-5.0, -2.0), (2.005, 2.005), (1.0, 1.0)])
def test_a_joint_beyond_its_limits_means_the_limit(scene, position, taken):
    found, remarks = understood(scene, joint_constraints=[JointConstraint("turn", position, 0.01, 0.01, 1.0)])
    one = found.joints[0]
    assert one.position == taken and bool(remarks) == (abs(position) == 5.0)
    state = scene.state.with_joints({"turn": min(2.0, max(-2.0, taken))})
    assert found.broken(scene.model, state, scene) is None


def test_a_name_that_is_nearly_right_is_told(scene):
    assert "'reach'" in understood(scene, joint_constraints=[JointConstraint("raech", 0.0, 0.1, 0.1, 1.0)])[1][0]
