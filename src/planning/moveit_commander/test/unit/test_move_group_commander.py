# SPDX-License-Identifier: BSD-3-Clause
"""MoveGroupCommander: what it takes, what it sends to move_group, and what it makes of the answers."""
import copy
import math
from types import SimpleNamespace

import genpy
import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from moveit_msgs.msg import (
    AttachedCollisionObject,
    Constraints,
    DisplayTrajectory,
    ExecuteTrajectoryResult,
    Grasp,
    MoveGroupResult,
    MoveItErrorCodes,
    PickupResult,
    PlaceLocation,
    PlaceResult,
    PlannerInterfaceDescription,
    RobotState,
    RobotTrajectory,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from moveit_commander import MoveGroupCommander, MoveItCommanderException, conversions
from moveit_commander.plan import PlanTuple


def trajectory():
    made = RobotTrajectory()
    made.joint_trajectory.joint_names = ["shoulder", "elbow"]
    made.joint_trajectory.points = [JointTrajectoryPoint(positions=[0.0, 1.0]),
                                    JointTrajectoryPoint(positions=[0.5, 1.2])]
    return made


# -- the group -----------------------------------------------------------------------------------------------------

def test_unknown_group_is_a_runtime_error(connection):
    with pytest.raises(RuntimeError, match="Group 'leg' was not found; the robot has arm, hand, all"):
        MoveGroupCommander("leg")


def test_new_commander_has_the_defaults_that_programs_rely_on(arm, connection):
    assert connection.waited_for == ["move_group", "execute_trajectory"]
    assert arm.get_name() == "arm"
    assert arm.get_active_joints() == ["shoulder", "elbow"]
    assert arm.get_joints() == ["shoulder", "elbow", "flange"]
    assert arm.get_variable_count() == 2
    assert arm.get_planning_time() == 5.0
    assert arm.get_goal_tolerance() == (1e-4, 1e-4, 1e-3)
    assert arm.has_end_effector_link() and arm.get_end_effector_link() == "tool"
    assert arm.get_planning_frame() == arm.get_pose_reference_frame() == "world"
    assert arm.get_named_targets() == ["ready"]
    request = arm.construct_motion_plan_request()
    assert request.num_planning_attempts == 1
    assert (request.max_velocity_scaling_factor, request.max_acceleration_scaling_factor) == (0.1, 0.2)
    assert request.start_state.is_diff and request.start_state.joint_state.name == []


def test_tolerances_of_a_group_come_from_the_parameter_server(connection):
    assert MoveGroupCommander("hand").get_goal_tolerance() == (0.01, 1e-4, 1e-3)


def test_a_group_without_a_single_tip_has_no_end_effector(connection):
    both = MoveGroupCommander("all")
    assert both.get_active_joints() == ["shoulder", "elbow", "grip"]
    if not both.has_end_effector_link():
        for call in (both.get_current_pose, both.get_current_rpy, both.get_random_pose,
                     lambda: both.set_pose_target([0.0] * 6), lambda: both.set_rpy_target([0.0] * 3),
                     lambda: both.set_position_target([0.0] * 3), lambda: both.shift_pose_target(0, 0.1)):
            with pytest.raises(MoveItCommanderException, match="no end effector"):
                call()
    both.set_end_effector_link("tool")
    assert both.get_current_pose().header.frame_id == "world"
    with pytest.raises(MoveItCommanderException, match="no link 'toe'"):
        both.set_end_effector_link("toe")


def test_interface_description_is_that_of_the_pipeline(arm, connection):
    ours, pilz = (PlannerInterfaceDescription(name=name, pipeline_id=name) for name in ("ompl", "pilz"))
    connection.answers["query_planner_interface"] = SimpleNamespace(planner_interfaces=[ours, pilz])
    assert arm.get_interface_description().name == "ompl"
    arm.set_planning_pipeline_id("pilz")
    assert arm.get_planning_pipeline_id() == "pilz"
    assert arm.get_interface_description().name == "pilz"
    arm.set_planning_pipeline_id("none")
    assert arm.get_interface_description() == PlannerInterfaceDescription()


# -- where it is ---------------------------------------------------------------------------------------------------

def test_current_values_and_pose(arm, connection):
    connection.joints.update(shoulder=math.pi / 2, elbow=math.pi / 2)
    assert arm.get_current_joint_values() == pytest.approx([math.pi / 2, math.pi / 2])
    pose = arm.get_current_pose()
    assert pose.header.frame_id == "world"
    assert conversions.pose_to_list(pose.pose)[:3] == pytest.approx([0.0, 0.4, 0.2], abs=1e-9)
    assert conversions.pose_to_list(arm.get_current_pose("upper").pose)[:3] == pytest.approx([0.0, 0.0, 0.5])
    assert arm.get_current_rpy("upper") == pytest.approx([0.0, 0.0, math.pi / 2])
    state = arm.get_current_state()
    assert state.joint_state.name == ["shoulder", "elbow", "grip", "oppose"]
    assert state.joint_state.header.stamp == state.multi_dof_joint_state.header.stamp == rospy.Time()


def test_a_base_that_moved_moves_the_pose(arm, connection):
    connection.base = np.eye(4)
    connection.base[:3, 3] = 1.0, 2.0, 3.0
    assert conversions.pose_to_list(arm.get_current_pose("upper").pose)[:3] == pytest.approx([1.0, 2.0, 3.5])


def test_a_state_that_move_group_does_not_know_is_said(arm, connection, monkeypatch):
    scene = connection.scene()
    scene.robot_state.joint_state = JointState(name=["grip"], position=[0.0])
    monkeypatch.setattr(connection, "scene", lambda: scene)
    with pytest.raises(MoveItCommanderException, match="where shoulder, elbow stand"):
        arm.get_current_joint_values()


def test_random_values_are_within_limits_and_differ(arm):
    values = np.array([arm.get_random_joint_values() for _ in range(200)])
    assert (values >= [-2.0, 0.2]).all() and (values <= [2.0, 2.6]).all()
    assert values.std(axis=0).min() > 0.3
    assert arm.get_random_pose().header.frame_id == "world"


# -- settings ------------------------------------------------------------------------------------------------------

def test_settings_reach_the_request(arm):
    arm.set_planning_time(2)
    arm.set_num_planning_attempts(4)
    arm.set_planner_id("RRTConnect")
    arm.set_planning_pipeline_id("ompl")
    arm.set_max_velocity_scaling_factor(1)
    arm.set_max_acceleration_scaling_factor(0.5)
    arm.set_workspace([-1, -2, 1, 2])
    arm.limit_max_cartesian_link_speed(0.2)
    arm.set_path_constraints(Constraints(name="upright"))
    arm.set_goal_tolerance(0.02)
    request = arm.construct_motion_plan_request()
    assert (request.allowed_planning_time, request.num_planning_attempts, request.planner_id, request.pipeline_id,
            request.max_velocity_scaling_factor, request.max_acceleration_scaling_factor) == (
        2.0, 4, "RRTConnect", "ompl", 1.0, 0.5)
    corners = request.workspace_parameters
    assert (corners.min_corner.x, corners.min_corner.y, corners.max_corner.x, corners.max_corner.y) == (-1, -2, 1, 2)
    assert corners.header.frame_id == "world"
    assert (request.cartesian_speed_limited_link, request.max_cartesian_speed) == ("tool", 0.2)
    assert request.path_constraints.name == "upright"
    assert request.goal_constraints[0].joint_constraints[0].tolerance_above == 0.02
    arm.clear_max_cartesian_link_speed()
    arm.clear_path_constraints()
    request = arm.construct_motion_plan_request()
    assert request.max_cartesian_speed == 0.0 and request.path_constraints == Constraints()


@pytest.mark.parametrize("value", [0.0, -0.1, 1.01, math.nan])
def test_scaling_is_above_zero_and_at_most_one(arm, value):
    for call in (arm.set_max_velocity_scaling_factor, arm.set_max_acceleration_scaling_factor):
        with pytest.raises(MoveItCommanderException, match="above 0 and at most 1"):
            call(value)


def test_other_bad_settings(arm):
    with pytest.raises(MoveItCommanderException, match="0, 4 or 6 values"):
        arm.set_workspace([1, 2, 3])
    for speed in (0.0, -1.0, math.nan):
        with pytest.raises(MoveItCommanderException, match="a speed above 0"):
            arm.limit_max_cartesian_link_speed(speed)
    with pytest.raises(MoveItCommanderException, match="no stored constraints named 'upright'"):
        arm.set_path_constraints("upright")
    assert arm.get_known_constraints() == []


def test_a_start_state_of_some_joints_is_laid_over_the_current_one(arm):
    arm.set_start_state(RobotState(joint_state=JointState(name=["elbow"], position=[0.4])))
    assert arm.construct_motion_plan_request().start_state.is_diff
    whole = JointState(name=["shoulder", "elbow", "grip"], position=[0.1, 0.4, 0.0])
    arm.set_start_state(RobotState(joint_state=whole))
    start = arm.construct_motion_plan_request().start_state
    assert not start.is_diff and start.joint_state.position == [0.1, 0.4, 0.0]
    arm.set_start_state_to_current_state()
    assert arm.construct_motion_plan_request().start_state == RobotState(is_diff=True)


# -- planning and moving -------------------------------------------------------------------------------------------

@pytest.fixture
def planned(connection, success):
    connection.results["move_group"] = MoveGroupResult(
        error_code=success, planned_trajectory=trajectory(), planning_time=0.25), "done"
    return connection


def test_plan_returns_noetics_tuple(arm, planned):
    success, plan, seconds, code = arm.plan([0.5, 1.2])
    assert success is True and code.val == MoveItErrorCodes.SUCCESS and seconds == 0.25
    assert len(plan.joint_trajectory.points) == 2
    action, goal = planned.sent[-1]
    assert action == "move_group" and goal.planning_options.plan_only
    assert goal.planning_options.planning_scene_diff.is_diff
    assert goal.request.goal_constraints[0].joint_constraints[0].position == 0.5


def test_plan_is_melodics_trajectory_too(arm, planned):
    plan = arm.plan()
    assert isinstance(plan, tuple) and plan[0] is True
    assert plan.joint_trajectory.joint_names == ["shoulder", "elbow"]
    assert len(plan.joint_trajectory.points) == 2
    plan.joint_trajectory.points[1].positions = [0.1, 0.2]
    plan.joint_trajectory = copy.deepcopy(plan.joint_trajectory)
    plan.joint_trajectory.points[1].velocities = [0.3, 0.4]
    assert plan[1].joint_trajectory.points[1].positions == [0.1, 0.2]
    assert plan[1].joint_trajectory.points[1].velocities == [0.3, 0.4]
    display = DisplayTrajectory()
    display.trajectory.append(plan)
    sent = DisplayTrajectory()
    conversions.msg_from_string(sent, conversions.msg_to_string(display))
    assert sent.trajectory[0].joint_trajectory.points[1].positions == (0.1, 0.2)
    assert conversions.msg_to_string(plan) == conversions.msg_to_string(plan[1])
    for copied in (copy.copy(plan), copy.deepcopy(plan)):
        assert isinstance(copied, PlanTuple) and copied.joint_trajectory == plan.joint_trajectory
    with pytest.raises(AttributeError):
        plan.points  # noqa: B018


def test_a_plan_that_failed_has_no_points(arm, connection):
    connection.results["move_group"] = MoveGroupResult(
        error_code=MoveItErrorCodes(MoveItErrorCodes.PLANNING_FAILED)), "elbow is in the way"
    plan = arm.plan()
    assert plan[0] is False and plan[3].val == MoveItErrorCodes.PLANNING_FAILED
    assert len(plan.joint_trajectory.points) == 0
    assert arm.go() is False


@pytest.mark.parametrize(("target", "kind"), [
    ([0.3, 0.7], "joints"), ({"shoulder": 0.3, "elbow": 0.7}, "joints"), ("ready", "joints"), ("kept", "joints"),
    (JointState(name=["shoulder"], position=[0.3]), "joints"), (Pose(orientation=Quaternion(w=1.0)), "pose"),
    (PoseStamped(pose=Pose(orientation=Quaternion(w=1.0))), "pose")])
def test_go_takes_targets(arm, planned, target, kind):
    arm.remember_joint_values("kept", [0.3, 0.7])
    assert arm.go(target) is True
    goal = planned.sent[-1][1]
    assert not goal.planning_options.plan_only
    constraints, = goal.request.goal_constraints
    assert bool(constraints.joint_constraints) == (kind == "joints")
    assert bool(constraints.position_constraints) == (kind == "pose")


@pytest.mark.parametrize("arguments", [{"joints": False}, {"wait": False}, {"joints": [0.1, 0.5], "wait": False}])
def test_go_without_waiting(arm, connection, arguments):
    assert arm.go(**arguments) is True
    assert connection.sent == [] and connection.started[0][0] == "move_group"


def test_replanning_and_looking_are_asked_for_when_moving_alone(arm, planned):
    arm.allow_replanning(True)
    arm.allow_looking(True)
    arm.go()
    options = planned.sent[-1][1].planning_options
    assert options.replan and options.look_around and options.replan_attempts == 1 and options.replan_delay == 2.0
    arm.plan()
    options = planned.sent[-1][1].planning_options
    assert not options.replan and not options.look_around


@pytest.mark.parametrize("form", [lambda plan: plan, lambda plan: plan[1], lambda plan: tuple(plan),
                                  lambda plan: plan[1].joint_trajectory])
def test_execute_takes_every_form_of_a_trajectory(arm, planned, success, form):
    planned.results["execute_trajectory"] = ExecuteTrajectoryResult(error_code=success), ""
    assert arm.execute(form(arm.plan())) is True
    action, goal = planned.sent[-1]
    assert action == "execute_trajectory"
    assert isinstance(goal.trajectory, RobotTrajectory) and len(goal.trajectory.joint_trajectory.points) == 2
    assert arm.execute(form(arm.plan()), wait=False) is True and planned.started[-1][0] == "execute_trajectory"
    assert arm.execute(trajectory=form(arm.plan())) is True and arm.execute(plan_msg=form(arm.plan())) is True


def test_execute_refuses_what_is_no_trajectory(arm):
    for wrong in ((True, None), "go", JointState()):
        with pytest.raises(TypeError, match="expected a RobotTrajectory"):
            arm.execute(wrong)
    assert JointTrajectory()._type == "trajectory_msgs/JointTrajectory"


def test_execute_that_fails(arm, connection):
    connection.results["execute_trajectory"] = ExecuteTrajectoryResult(
        error_code=MoveItErrorCodes(MoveItErrorCodes.CONTROL_FAILED)), "no controller"
    assert arm.execute(trajectory()) is False


def test_stop_says_stop_and_cancels(arm, connection):
    arm.stop()
    assert [(name, message.data) for name, message in connection.published] == [("trajectory_execution_event", "stop")]
    assert connection.cancelled == 1


@pytest.mark.parametrize(("arguments", "jump", "avoid", "path"), [
    ((0.01, 2.0), 2.0, True, ""), ((0.01, 0.0, False, Constraints(name="c")), 0.0, False, "c"),
    ((0.01,), 0.0, True, ""), ((0.01, False), 0.0, False, ""), ((0.01, True, Constraints(name="c")), 0.0, True, "c")])
def test_cartesian_paths_in_the_old_and_the_new_form(arm, connection, success, arguments, jump, avoid, path):
    connection.answers["compute_cartesian_path"] = SimpleNamespace(
        error_code=success, solution=trajectory(), fraction=0.5)
    plan, fraction = arm.compute_cartesian_path([Pose(), [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]], *arguments)
    assert fraction == 0.5 and len(plan.joint_trajectory.points) == 2
    fields = connection.called[-1][1]
    assert (fields["max_step"], fields["jump_threshold"], fields["avoid_collisions"], fields["link_name"]) == (
        0.01, jump, avoid, "tool")
    assert fields["path_constraints"].name == path and fields["header"].frame_id == "world"
    assert fields["waypoints"][1].position.y == 0.2 and fields["start_state"].is_diff


def test_a_cartesian_path_that_is_an_error(arm, connection):
    connection.answers["compute_cartesian_path"] = SimpleNamespace(
        error_code=MoveItErrorCodes(MoveItErrorCodes.FAILURE), solution=trajectory(), fraction=0.0)
    assert arm.compute_cartesian_path([Pose()], 0.0, 0.0) == (RobotTrajectory(), -1.0)


# -- objects -------------------------------------------------------------------------------------------------------

def test_attaching_and_detaching(arm, connection):
    connection.answers["apply_planning_scene"] = SimpleNamespace(success=True)
    assert arm.attach_object("can") is True
    message = connection.called[-1][1]["scene"]
    attached, = message.robot_state.attached_collision_objects
    assert message.is_diff and message.robot_state.is_diff
    assert (attached.link_name, attached.object.id, attached.touch_links) == ("tool", "can", ["tool"])
    arm.attach_object("can", "finger", ["tool", "finger"])
    attached, = connection.called[-1][1]["scene"].robot_state.attached_collision_objects
    assert (attached.link_name, attached.touch_links) == ("finger", ["tool", "finger"])
    for name, link, object_name in (("can", "", "can"), ("finger", "finger", "")):
        arm.detach_object(name)
        attached, = connection.called[-1][1]["scene"].robot_state.attached_collision_objects
        assert (attached.link_name, attached.object.id) == (link, object_name)
        assert attached.object.operation == attached.object.REMOVE


def test_detaching_all_lets_go_of_what_the_group_holds(arm, connection):
    connection.answers["apply_planning_scene"] = SimpleNamespace(success=True)
    for link, name in (("tool", "can"), ("base", "lamp"), ("finger", "pen")):
        connection.held.append(AttachedCollisionObject(link_name=link))
        connection.held[-1].object.id = name
    assert arm.detach_object() is True
    done = [fields["scene"].robot_state.attached_collision_objects[0].object.id
            for name, fields in connection.called if name == "apply_planning_scene"]
    assert done == ["can", "pen"]


def test_pick_sends_grasps_and_returns_a_number(arm, connection, success):
    connection.results["pickup"] = PickupResult(error_code=success), ""
    arm.set_support_surface_name("table")
    assert arm.pick("can", Grasp(id="top")) == MoveItErrorCodes.SUCCESS
    goal = connection.sent[-1][1]
    assert (goal.target_name, goal.group_name, goal.end_effector) == ("can", "arm", "gripper")
    assert [grasp.id for grasp in goal.possible_grasps] == ["top"]
    assert goal.support_surface_name == "table" and goal.allow_gripper_support_collision
    assert not goal.planning_options.plan_only and "pickup" in connection.waited_for
    arm.pick("can", [Grasp(), Grasp()], plan_only=True)
    assert len(connection.sent[-1][1].possible_grasps) == 2 and connection.sent[-1][1].planning_options.plan_only
    with pytest.raises(MoveItCommanderException, match="expected a Grasp"):
        arm.pick("can", ["top"])


def test_place_at_every_kind_of_location(arm, connection):
    connection.results["place"] = PlaceResult(error_code=MoveItErrorCodes(MoveItErrorCodes.PLANNING_FAILED)), ""
    stamped = conversions.list_to_pose_stamped([0.1, 0.2, 0.3, 0.0, 0.0, 0.0], "base")
    for location, ids in ((None, []), (Pose(), ["world"]), (stamped, ["base"]), ([stamped, stamped], ["base", "base"]),
                          (PlaceLocation(place_pose=stamped), ["base"])):
        assert arm.place("can", location) == MoveItErrorCodes.PLANNING_FAILED
        goal = connection.sent[-1][1]
        assert goal.attached_object_name == "can"
        assert [one.place_pose.header.frame_id for one in goal.place_locations] == ids
    arm.place("can", stamped)
    place, = connection.sent[-1][1].place_locations
    assert place.pre_place_approach.direction.vector.z == -1.0 and place.pre_place_approach.desired_distance > 0.0
    assert place.post_place_retreat.direction.header.frame_id == "tool"
    with pytest.raises(MoveItCommanderException, match="expected a Pose"):
        arm.place("can", "table")


# -- computations --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("point", [None, [0.1, -0.2, 0.3]])
def test_jacobian_is_the_derivative_of_the_pose(arm, model, point):
    values, step = np.array([0.4, 0.9]), 1e-6
    matrix = arm.get_jacobian_matrix(values.tolist(), point)
    assert matrix.shape == (6, 2)
    offset = np.array([*(point or [0.0] * 3), 1.0])

    def place(q):
        return (model.frame_of([*q, 0.0], "tool") @ offset)[:3]

    for joint in range(2):
        shift = np.eye(2)[joint] * step
        np.testing.assert_allclose(matrix[:3, joint], (place(values + shift) - place(values - shift)) / (2 * step),
                                   atol=1e-6)
    np.testing.assert_allclose(matrix[3:, 0], [0.0, 0.0, 1.0], atol=1e-9)


@pytest.mark.parametrize("algorithm", ["iterative_time_parameterization", "iterative_spline_parameterization",
                                       "time_optimal_trajectory_generation"])
def test_retiming_keeps_the_ends_and_the_limits(arm, model, algorithm):
    made = arm.retime_trajectory(arm.get_current_state(), trajectory(), 0.5, 0.5, algorithm).joint_trajectory
    assert made.joint_names == ["shoulder", "elbow"] and len(made.points) >= 2
    np.testing.assert_allclose([made.points[0].positions, made.points[-1].positions], [[0.0, 1.0], [0.5, 1.2]],
                               atol=1e-9)
    times = [point.time_from_start.to_sec() for point in made.points]
    assert times[0] == 0.0 and all(np.diff(times) > 0.0)
    assert max(abs(value) for point in made.points for value in point.velocities) <= 0.5 + 1e-6
    slower = arm.retime_trajectory(arm.get_current_state(), trajectory(), 0.1, 0.5, algorithm).joint_trajectory
    assert slower.points[-1].time_from_start > made.points[-1].time_from_start


def test_retiming_what_cannot_be_timed(arm):
    state = arm.get_current_state()
    assert arm.retime_trajectory(state, trajectory(), algorithm="by_magic") == RobotTrajectory()
    assert arm.retime_trajectory(state, RobotTrajectory()).joint_trajectory.points == []
    wrong = trajectory()
    wrong.joint_trajectory.joint_names = ["shoulder", "toe"]
    with pytest.raises(MoveItCommanderException, match="moves toe"):
        arm.retime_trajectory(state, wrong)
    broken = trajectory()
    broken.joint_trajectory.points[1].positions = [math.nan, 0.0]
    with pytest.raises(MoveItCommanderException, match="cannot be timed"):
        arm.retime_trajectory(state, broken)


def test_enforcing_bounds(arm):
    state = RobotState(joint_state=JointState(name=["shoulder", "elbow"], position=[3.0, 0.0]))
    bounded = arm.enforce_bounds(state).joint_state
    assert dict(zip(bounded.name, bounded.position, strict=True)) == {
        "shoulder": 2.0, "elbow": 0.2, "grip": 0.0, "oppose": 0.01}
    with pytest.raises(genpy.DeserializationError):
        arm.enforce_bounds(RobotState())


def test_current_state_within_bounds(arm, connection):
    connection.joints["elbow"] = 2.7
    assert arm.get_current_state_bounded().joint_state.position[1] == 2.6
