# SPDX-License-Identifier: BSD-3-Clause
"""Markers and what is read from messages."""
import numpy as np
import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, DisplayTrajectory, ObjectColor, PlanningScene
from shape_msgs.msg import Mesh, MeshTriangle, Plane, SolidPrimitive
from visualization_msgs.msg import InteractiveMarkerControl, Marker, MenuEntry

from motion_planning_rviz import drawing, handles, menu, messages
from motion_planning_rviz.interaction import InteractionError
from motion_planning_rviz.node import PanelNode
from urdf_model import Box
from urdf_model.transforms import pose_matrix


def test_poses_there_and_back():
    matrix = pose_matrix((1.0, 2.0, 3.0), (0.3, -0.2, 0.1))
    np.testing.assert_allclose(messages.matrix_of(messages.pose_message(matrix)), matrix, atol=1e-12)
    np.testing.assert_array_equal(messages.matrix_of(Pose()), np.eye(4))
    with pytest.raises(ValueError, match="not finite"):
        messages.matrix_of(Pose(Point(float("nan"), 0, 0), Quaternion(0, 0, 0, 1)))


def test_codes_have_names():
    assert (messages.code_name(-31), messages.code_name(1234)) == ("NO_IK_SOLUTION", "error code 1234")


def test_scenes_that_tell_of_joints_alone():
    def moved():
        message = PlanningScene(is_diff=True)
        message.robot_state.joint_state.name = ["turn"]
        return message

    assert messages.tells_joints_alone(moved())
    # An object that was added and removed between two messages is in neither, and so is nothing else.
    assert not messages.tells_joints_alone(PlanningScene(is_diff=True))
    whole, with_object, with_colour, with_held, with_octomap = (moved() for _ in range(5))
    whole.is_diff = False
    with_object.world.collision_objects = [CollisionObject()]
    with_colour.object_colors = [ObjectColor()]
    with_held.robot_state.attached_collision_objects = [AttachedCollisionObject()]
    with_octomap.world.octomap.octomap.data = [1]
    assert not any(map(messages.tells_joints_alone, (whole, with_object, with_colour, with_held, with_octomap)))


def test_a_marker_shows_a_shape():
    pose = pose_matrix((1.0, 0.0, 0.0), (0.0, 0.0, 0.5))
    one = drawing.DrawnSolid("crate", 3, drawing.solid_of(Box((0.1, 0.2, 0.3)), np.eye(4)), pose, drawing.THING)
    marker = messages.marker_of(one, "base")
    assert (marker.ns, marker.id, marker.type, marker.header.frame_id) == ("crate", 3, Marker.CUBE, "base")
    assert (marker.scale.x, marker.scale.y, marker.scale.z) == (0.1, 0.2, 0.3)
    assert (marker.pose.position.x, marker.color.a) == (1.0, drawing.THING[3])


def test_objects_of_both_forms():
    """The older form has poses of shapes in the header's frame; the newer one has a pose for all of them."""
    turned = Quaternion(0.0, 0.0, 0.0, 1.0)
    message = CollisionObject(
        id="things", pose=Pose(Point(1.0, 0.0, 0.0), turned),
        primitives=[SolidPrimitive(SolidPrimitive.BOX, [1, 2, 3]), SolidPrimitive(SolidPrimitive.CYLINDER, [2.0, 0.5]),
                    SolidPrimitive(SolidPrimitive.SPHERE, [])],
        primitive_poses=[Pose(Point(0.0, 1.0, 0.0), turned)] * 3,
        meshes=[Mesh([MeshTriangle((0, 1, 2))], [Point(0, 0, 0), Point(1, 0, 0), Point(0, 1, 0)]), Mesh()],
        mesh_poses=[Pose(Point(), turned)] * 2,
        planes=[Plane((1.0, 0.0, 0.0, -2.0))], plane_poses=[Pose(Point(), turned)])
    box, cylinder, mesh, plane = messages.object_solids(message)
    assert box.pose[:3, 3].tolist() == [1.0, 1.0, 0.0] and cylinder.size == (1.0, 1.0, 2.0)
    assert mesh.kind == "triangles" and len(mesh.points) == 3
    # x = 2 in the object, which stands at 1.
    np.testing.assert_allclose(plane.pose[:3, 3], (3.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(plane.pose[:3, 2], (1.0, 0.0, 0.0), atol=1e-12)
    message.pose = Pose()
    assert messages.object_solids(message)[0].pose[:3, 3].tolist() == [0.0, 1.0, 0.0]


def test_a_path_is_laid_over_its_start(twins, trajectory):
    message = DisplayTrajectory()
    message.trajectory_start.joint_state.name = ["right_turn", "wheel"]
    message.trajectory_start.joint_state.position = [0.7, 1.0]
    with pytest.raises(ValueError, match="no points"):
        messages.playback_of(twins, message)
    for part in (trajectory(0.0, 1.0), trajectory(0.0, 2.0)):
        part.joint_trajectory.joint_names = ["left_turn"]
        for point, value in zip(part.joint_trajectory.points, (0.0, 1.0), strict=True):
            point.positions = [value]
        message.trajectory.append(part)
    film = messages.playback_of(twins, message)
    assert film.times.tolist() == [0.0, 1.0, 1.0, 3.0]
    assert (film.postures[:, twins.index["right_turn"]] == 0.7).all()
    assert film.postures[:, twins.index["left_turn"]].tolist() == [0.0, 1.0, 0.0, 1.0]


def test_markers_have_the_panels_names_and_six_axes():
    marker = handles.marker_message("goal", "tool0", pose_matrix((0.1, 0.2, 0.3)), "world", 0.2)
    assert (marker.name, marker.header.frame_id, marker.header.stamp.to_nsec()) == ("EE:goal_tool0", "world", 0)
    modes = [control.interaction_mode for control in marker.controls]
    kinds = InteractiveMarkerControl
    assert sorted(modes) == sorted([kinds.MOVE_ROTATE_3D] + 3 * [kinds.MOVE_AXIS] + 3 * [kinds.ROTATE_AXIS])
    for control in marker.controls:
        turn = control.orientation
        axis = messages.matrix_of(Pose(Point(), turn))[:3, 0]
        if control.name[-2] == "_":
            np.testing.assert_allclose(np.abs(axis), np.eye(3)["xyz".index(control.name[-1])], atol=1e-12)


@pytest.mark.parametrize("later", [menu.MenuState(objects=("box",)), menu.MenuState(attached=("can",), own_start=True),
                                   menu.MenuState(states=("home", "up"), objects=("can", "box")), menu.MenuState()])
def test_a_number_means_the_same_in_every_menu(later):
    """A click on a menu that changes at that moment does what was read there."""
    numbers = {}
    before = {entry.number: (entry.parent, entry.command) for entry in
              menu.build(menu.MenuState(states=("home",), attached=("box",)), numbers)}
    after = {entry.number: (entry.parent, entry.command) for entry in menu.build(later, numbers)}
    assert all(after[number] == before[number] for number in after.keys() & before.keys())
    assert {("plan",), ("stop",)} <= {after[number][1] for number in after.keys() & before.keys()}


def test_menu_entries_come_back_by_number():
    entries = menu.build(menu.MenuState(states=("home",)), {})
    found = handles.menu_entries(entries)
    assert [entry.id for entry in found] == [entry.number for entry in entries]
    assert {entry.command_type for entry in found} == {MenuEntry.FEEDBACK}


def test_a_frame_with_a_zero_is_refused_at_once_by_name(probot):
    """tf2's library raises an error of its own for such names."""
    node = object.__new__(PanelNode)
    node._model, node._buffer = probot, tf2_ros.BufferCore(rospy.Duration(10))
    with pytest.raises(InteractionError, match=r"^'no\\x00where' is not a frame"):
        node._in_root("no\0where")
