# SPDX-License-Identifier: BSD-3-Clause
"""Uses of the wrapped objects inside commanders: messages as bytes, poses as lists."""
import pytest
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from moveit_msgs.msg import (
    CollisionObject,
    Constraints,
    ExecuteTrajectoryResult,
    Grasp,
    MotionPlanRequest,
    MoveGroupResult,
    MoveItErrorCodes,
    PickupResult,
    PlaceLocation,
    PlaceResult,
    PlanningScene,
    RobotState,
    RobotTrajectory,
)
from moveit_msgs.srv import GetCartesianPathResponse
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint
from visualization_msgs.msg import MarkerArray

from moveit_commander import PlanningSceneInterface, RobotCommander
from moveit_commander.conversions import msg_from_string, msg_to_string, pose_to_list

HERE = [0.3, 0.1, 0.4, 0.0, 0.0, 0.0, 1.0]


def read(kind, data):
    assert isinstance(data, bytes)
    message = kind()
    msg_from_string(message, data)
    return message


@pytest.fixture
def group(arm):
    return arm._g


@pytest.fixture
def robot(connection):
    return RobotCommander()._r


def test_what_needs_no_bytes_is_the_commanders_own(arm, group):
    group.set_planning_time(3.0)
    assert arm.get_planning_time() == group.get_planning_time() == 3.0
    assert group.get_joints() == ["shoulder", "elbow", "flange"] and group.get_variables() == ["shoulder", "elbow"]
    assert group.get_named_targets() == ["ready"] and group.start_state_monitor(1.0)
    with pytest.raises(AttributeError):
        group.fly()


def test_a_pose_is_a_list_and_a_state_a_dictionary_or_bytes(arm, group):
    assert group.get_current_pose() == pose_to_list(arm.get_current_pose().pose)
    assert len(group.get_random_pose()) == 7
    assert group.get_current_state_bounded()["elbow"] == 1.0
    state = read(RobotState, group.get_current_state())
    assert "elbow" in state.joint_state.name
    assert read(RobotState, group.enforce_bounds(msg_to_string(state))).joint_state.name == state.joint_state.name
    group.set_start_state(msg_to_string(state))
    assert read(MotionPlanRequest, group.construct_motion_plan_request()).start_state.joint_state.name


def test_targets_tell_whether_they_are_possible(arm, group):
    assert group.set_joint_value_target([0.5, 1.0]) and arm.get_joint_value_target() == [0.5, 1.0]
    assert group.set_joint_value_target("elbow", 1.5) and not group.set_joint_value_target("elbow", 9.0)
    assert group.set_joint_value_target_from_joint_state_message(
        msg_to_string(JointState(name=["elbow"], position=[1.2])))
    assert arm.get_joint_value_target()[1] == 1.2
    assert group.set_named_target("ready") and not group.set_named_target("nowhere")
    assert group.set_pose_target(HERE) and group.set_pose_targets([HERE, HERE[:6]]) and not group.set_pose_target([1.0])
    assert group.set_position_target(0.3, 0.1, 0.4) and group.set_rpy_target(0.0, 0.0, 0.1)
    assert group.set_orientation_target(0.0, 0.0, 0.0, 1.0, "tool")
    assert group.set_end_effector_link("lower") and not group.set_end_effector_link("tail")
    assert not group.set_path_constraints("upright")


def test_constraints_and_workspace(arm, group):
    group.set_path_constraints_from_msg(msg_to_string(Constraints(name="upright")))
    assert arm.get_path_constraints().name == read(Constraints, group.get_path_constraints()).name == "upright"
    group.set_workspace(-1.0, -1.0, -1.0, 1.0, 1.0, 1.0)
    assert arm.construct_motion_plan_request().workspace_parameters.max_corner.z == 1.0


def test_plans_are_bytes_that_can_be_executed(group, connection, success):
    planned = RobotTrajectory()
    planned.joint_trajectory.joint_names = ["shoulder", "elbow"]
    planned.joint_trajectory.points = [JointTrajectoryPoint(positions=[0.0, 1.0])]
    connection.results = {
        "move_group": (MoveGroupResult(error_code=success, planned_trajectory=planned, planning_time=0.25), ""),
        "execute_trajectory": (ExecuteTrajectoryResult(error_code=success), "")}
    code, trajectory, seconds = group.plan()
    assert read(MoveItErrorCodes, code).val == MoveItErrorCodes.SUCCESS and seconds == 0.25
    assert group.move() and group.execute(trajectory) and group.async_execute(trajectory) and group.async_move()
    assert connection.sent[-1][1].trajectory == planned


def test_a_cartesian_path_goes_through_lists_with_and_without_a_threshold(group, connection, success):
    connection.answers["compute_cartesian_path"] = GetCartesianPathResponse(error_code=success, fraction=0.5)
    bounds = msg_to_string(Constraints(name="upright"))
    for options in ((0.0, True, bounds), (True, bounds), (0.0, True)):
        trajectory, fraction = group.compute_cartesian_path([HERE, HERE[:6]], 0.01, *options)
        assert fraction == 0.5 and read(RobotTrajectory, trajectory) == RobotTrajectory()
        asked = connection.called[-1][1]
        assert len(asked["waypoints"]) == 2 and asked["avoid_collisions"] is True
        assert asked["path_constraints"].name == ("upright" if bounds in options else "")


def test_picking_and_placing(group, connection, success):
    connection.results = {"pickup": (PickupResult(error_code=success), ""),
                          "place": (PlaceResult(error_code=success), "")}
    grasp = msg_to_string(Grasp(id="top"))
    assert group.pick("cup", [grasp, grasp], True) == group.pick("cup", grasp) == group.pick("cup") == 1
    assert [len(goal.possible_grasps) for _, goal in connection.sent] == [2, 1, 0]
    assert connection.sent[0][1].planning_options.plan_only and not connection.sent[1][1].planning_options.plan_only
    stamped = msg_to_string(PoseStamped(pose=Pose(orientation=Quaternion(w=1.0))))
    assert group.place("cup", HERE) and group.place("cup", msg_to_string(PlaceLocation(id="there")), False)
    assert group.place("cup") and group.place_poses_list("cup", [stamped] * 2)
    assert group.place_locations_list("cup", [msg_to_string(PlaceLocation(id="here"))], True)
    assert [len(goal.place_locations) for _, goal in connection.sent[3:]] == [1, 1, 0, 2, 1]


def test_the_robot(robot):
    assert robot.get_robot_name() == "arm" and robot.get_robot_root_link() == "base"
    assert robot.get_planning_frame() == "world" and robot.has_group("hand")
    assert robot.get_group_joint_names("arm") == ["shoulder", "elbow", "flange"]
    assert robot.get_group_joint_names("x") == []
    assert robot.get_group_active_joint_names("hand") == ["grip"] and robot.get_group_joint_tips("arm") == ["tool"]
    assert "tool" in robot.get_group_link_names("arm") and robot.get_group_default_states("arm") == ["ready"]
    assert robot.get_joint_values("arm", "ready") == {"shoulder": 0.5, "elbow": 1.0}
    assert robot.get_joint_values("arm", "none") == robot.get_joint_values("x", "ready") == {}
    assert robot.get_parent_group("hand") == ("arm", "tool") and robot.get_parent_group("arm") == ("", "")
    assert robot.get_joint_limits("elbow") == [[0.2, 2.6]] and robot.get_joint_limits("flange") == []
    assert robot.get_current_joint_values("elbow") == [1.0] and robot.get_current_joint_values("flange") == []
    assert len(robot.get_current_joint_values("stand")) == len(robot.get_link_pose("tool")) == 7
    assert robot.get_link_pose("tail") == []
    state = robot.get_current_state()
    assert read(RobotState, state).joint_state.name
    for markers in (robot.get_robot_markers(), robot.get_robot_markers(state), robot.get_group_markers("arm")):
        read(MarkerArray, markers)
    with pytest.raises(AttributeError):
        _ = robot.shoulder


def test_the_scene(connection):
    scene = PlanningSceneInterface()._psi
    connection.objects = [CollisionObject(id="cup")]
    assert scene.get_known_object_names() == ["cup"]
    assert read(CollisionObject, scene.get_objects(["cup"])["cup"]).id == "cup"
    assert read(Pose, scene.get_object_poses(["cup"])["cup"]) == Pose() and scene.get_attached_objects() == {}
    read(PlanningScene, scene.get_planning_scene(1))
    connection.answers["apply_planning_scene"] = type("Answer", (), {"success": True})
    assert scene.apply_planning_scene(msg_to_string(PlanningScene(name="new", is_diff=True)))
    assert connection.called[-1][1]["scene"].name == "new"
