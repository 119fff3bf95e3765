# SPDX-License-Identifier: BSD-3-Clause
"""The node as its parameters make it; no ROS around it."""
import sys
import threading
from pathlib import Path

import pytest
import rospy
from dynamic_reconfigure.msg import BoolParameter, Config, DoubleParameter, IntParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from moveit_msgs.msg import MoveGroupResult, MoveItErrorCodes
from moveit_msgs.srv import ExecuteKnownTrajectoryRequest

from disk_cache import compiler_pages
from motion_planning.errors import PlanningError
from motion_planning.spheres import checker, sphere_model
from moveit_ros_move_group import settings
from moveit_ros_move_group.capabilities import motion
from moveit_ros_move_group.capabilities.motion import MoveAction
from moveit_ros_move_group.planning import Planner

sys.path.insert(0, str(Path(__file__).parents[1]))
from bad_requests import outcome  # noqa: E402
from good_requests import good_requests  # noqa: E402
from in_process import PREPARED_S, Node, Server  # noqa: E402
from small_arm import SIX, joint_state, parameters  # noqa: E402


def node_of(monkeypatch, **private):
    tree = parameters()
    tree["~"] = {**tree["~"], **private}
    node = Node(monkeypatch, tree)
    node.topics["joint_states"](joint_state())
    return node


def test_without_execution_nothing_is_executed_and_the_reason_is_said(monkeypatch):
    node = node_of(monkeypatch, allow_trajectory_execution=False, capabilities="move_group/MoveGroupExecuteService")
    goal = good_requests(SIX)["execute_trajectory"]
    code, text = outcome(node.ask("execute_trajectory", goal))
    assert code == MoveItErrorCodes.CONTROL_FAILED and "allow_trajectory_execution is false" in text
    for waits in (True, False):
        answer = node.ask("execute_kinematic_path", ExecuteKnownTrajectoryRequest(goal.trajectory, waits))
        assert answer.error_code.val == MoveItErrorCodes.CONTROL_FAILED
    assert all("allow_trajectory_execution is false" in one.text for one in node.told("~failures"))


def test_nothing_is_served_before_spheres_and_scene_are_ready(monkeypatch):
    """A request must not wait for them, nor be answered without what the parameters say of the scene."""
    events = []

    def noted(event, function):
        def call(*arguments, **options):
            result = function(*arguments, **options)
            events.append(event)
            return result
        return call

    monkeypatch.setattr(sphere_model, "cached", noted("spheres", sphere_model.cached))
    monkeypatch.setattr(checker, "bake", noted("tables", checker.bake))
    monkeypatch.setattr(settings, "described_scene", noted("scene", settings.described_scene))
    monkeypatch.setattr(Server, "start", noted("served", Server.start))
    node = Node(monkeypatch, parameters(), noted("served", lambda name: None))
    served = events.index("served")
    assert {"spheres", "tables", "scene"} <= set(events[:served]) and set(events[served:]) == {"served"}
    assert events.count("served") == len(node.services) + len(node.servers) > 15
    node.topics["joint_states"](joint_state())
    code, text = outcome(node.ask("plan_kinematic_path", good_requests(SIX)["plan_kinematic_path"]))
    assert code == MoveItErrorCodes.SUCCESS, text
    assert "spheres" not in events[served:]


def test_a_robot_that_takes_long_to_prepare_delays_nothing_but_plans(monkeypatch):
    may_end, ended = threading.Event(), threading.Event()
    monkeypatch.setattr(Planner, "_warm_up", lambda self: may_end.wait(PREPARED_S))
    monkeypatch.setattr(compiler_pages, "release", ended.set)
    node = Node(monkeypatch, parameters(), prepared_s=0.01)
    node.topics["joint_states"](joint_state())
    code, text = outcome(node.ask("compute_fk", good_requests(SIX)["compute_fk"]))
    assert code == MoveItErrorCodes.SUCCESS, text
    assert any("being prepared for planning" in line for line in node.logged) and not ended.is_set()
    answers = []
    plan = threading.Thread(target=lambda: answers.append(outcome(node.ask(
        "plan_kinematic_path", good_requests(SIX)["plan_kinematic_path"]))), daemon=True)
    plan.start()
    # A goal that is cancelled does not wait on.
    node.servers["move_group"].preempted.set()
    code, text = outcome(node.ask("move_group", good_requests(SIX)["move_group"]))
    assert code == MoveItErrorCodes.PREEMPTED and not answers
    may_end.set()
    assert ended.wait(PREPARED_S)
    plan.join(PREPARED_S)
    assert answers[0][0] == MoveItErrorCodes.SUCCESS, answers


def test_looking_around_without_a_sensor_to_point_plans_as_usual_and_is_told(monkeypatch):
    node = node_of(monkeypatch)
    goal = good_requests(SIX)["move_group"]
    goal.planning_options.plan_only, goal.planning_options.look_around = False, True
    goal.request.start_state.joint_state.name = []
    with node.hearing("joint_states", joint_state):
        code, text = outcome(node.ask("move_group", goal))
    assert code == MoveItErrorCodes.SUCCESS, text
    assert len([line for line in node.logged if "look_around" in line and "sensor" in line]) == 1


def test_an_attempt_is_used_up_by_another_way_and_not_by_none(monkeypatch):
    """Joints for which there is no way while they move stop, and a plan from rest is tried with the same attempt."""
    node = node_of(monkeypatch)
    action = next(one for one in node.kept if isinstance(one, MoveAction))
    asked, left = [], motion._Attempts(1)

    def redirected(*_):
        asked.append(True)
        raise PlanningError("a wall")

    monkeypatch.setattr(action._planner, "redirected", redirected)
    onward = action._onward(good_requests(SIX)["move_group"].request, left, MoveGroupResult())
    with pytest.raises(PlanningError, match="a wall"):
        onward.search(None, None, lambda: False)
    assert left.any() and left.take()
    with pytest.raises(PlanningError, match="used up"):
        onward.search(None, None, lambda: False)
    assert len(asked) == 1


def test_a_capability_that_is_not_served_is_named_in_the_log(monkeypatch):
    node = node_of(monkeypatch, capabilities="move_group/Cleaning some_package/Cooking")
    assert len([line for line in node.logged if "move_group/Cleaning" in line]) == 1
    assert len([line for line in node.logged if "some_package/Cooking" in line]) == 1


def test_a_cartesian_path_begins_whenever_it_is_sent(monkeypatch):
    """With a stamp a controller would leave out what was due before it came."""
    node = node_of(monkeypatch)
    answer = node.ask("compute_cartesian_path", good_requests(SIX)["compute_cartesian_path"])
    assert answer.fraction > 0.0
    assert answer.solution.joint_trajectory.header.stamp.is_zero()


def reconfigured(node, server, **values):
    config = Config()
    for name, value in values.items():
        field, kind = {bool: ("bools", BoolParameter), int: ("ints", IntParameter),
                       float: ("doubles", DoubleParameter)}[type(value)]
        getattr(config, field).append(kind(name, value))
    answer = node.ask("~%s/set_parameters" % server, ReconfigureRequest(config)).config
    return {one.name: one.value for field in (answer.bools, answer.ints, answer.doubles) for one in field}


def test_settings_can_be_changed_while_it_runs(monkeypatch):
    node = node_of(monkeypatch, plan_execution={"max_replan_attempts": 3})
    execution = node.context.executor.settings
    now = reconfigured(node, "trajectory_execution", execution_duration_monitoring=False, allowed_start_tolerance=0.2,
                       allowed_execution_duration_scaling=99.0)
    assert (execution.monitored, execution.start_tolerance, execution.scaling) == (False, 0.2, 10.0)
    assert now["allowed_execution_duration_scaling"] == 10.0 and now["wait_for_trajectory_completion"] is False
    reconfigured(node, "planning_scene_monitor", publish_planning_scene=True, publish_planning_scene_hz=20.0)
    assert node.context.monitor.publishes and node.context.monitor.hz == 20.0
    action = next(one for one in node.kept if isinstance(one, MoveAction))
    assert action.replan_attempts == 3
    reconfigured(node, "plan_execution", max_replan_attempts=1)
    assert action.replan_attempts == 1


def test_tolerances_of_single_joints_outlive_a_change_of_the_usual_one(monkeypatch):
    node = node_of(monkeypatch, trajectory_execution={"joints_allowed_start_tolerance": {"j1": 0.5}})
    reconfigured(node, "trajectory_execution", allowed_start_tolerance=0.3)
    tolerance = node.context.executor.settings.start_tolerance
    assert (tolerance.get("j1"), tolerance.get("j2")) == (0.5, 0.3)


def test_a_setting_that_is_not_there_is_refused(monkeypatch):
    node = node_of(monkeypatch)
    with pytest.raises(rospy.ServiceException, match="there is no setting 'colour'"):
        reconfigured(node, "plan_execution", colour=1)
