# SPDX-License-Identifier: BSD-3-Clause
"""A goal that is cancelled ends soon, whatever is being done for it, and says so."""
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from moveit_msgs.msg import MoveItErrorCodes, PositionConstraint

from lab_testing.waiting import wait_until
from motion_planning import pipeline
from motion_planning.scene import WorldObject
from urdf_model import Box
from urdf_model.transforms import pose_matrix

sys.path.insert(0, str(Path(__file__).parents[1]))
from good_requests import box, diff, framed, good_requests, joint_goal  # noqa: E402
from in_process import Node  # noqa: E402
from small_arm import ASIDE, FREE, SIX, joint_state, parameters  # noqa: E402

# As long as a goal may be given: without being cancelled none of these would end in time.
ALLOWED_S = 600.0
TIMEOUT_S = 60.0


@pytest.fixture(scope="module")
def node():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("moveit_ros_move_group.capabilities.motion._STATE_TIMEOUT_S", ALLOWED_S)
        yield Node(patch, parameters("interpolate"))


@pytest.fixture
def standing(node):
    """The arm stands at FREE, and says so."""
    with node.hearing("joint_states", joint_state):
        yield


@pytest.fixture(autouse=True)
def as_before(node):
    node.servers["move_group"].preempted.clear()
    scene = node.context.monitor.scene()
    yield
    node.context.monitor.change(lambda _: scene, "test")


def goal_of(node, *constraints, plan_only=True):
    goal = good_requests(SIX)["move_group"]
    goal.request.allowed_planning_time, goal.planning_options.plan_only = ALLOWED_S, plan_only
    if constraints:
        goal.request.goal_constraints = list(constraints)
    return goal


def cancelled(node, goal, when, endpoint="move_group"):
    """Cancel a goal once ``when()``; return (code, text)."""
    server, answer = node.servers[endpoint], []
    thread = threading.Thread(target=lambda: answer.append(server.ask(goal)), daemon=True)
    thread.start()
    wait_until(when, "the phase to come", TIMEOUT_S)
    begin = time.monotonic()
    server.preempted.set()
    thread.join(TIMEOUT_S)
    assert answer, "a cancelled goal goes on"
    print("%.1f ms" % (1e3 * (time.monotonic() - begin)))
    server.preempted.clear()
    return answer[0][1].error_code.val, answer[0][2]


def watched(patch, owner, name):
    """An Event that is set when a function is called."""
    function, called = getattr(owner, name), threading.Event()
    patch.setattr(owner, name, lambda *values, **options: called.set() or function(*values, **options))
    return called


def test_while_it_waits_for_a_joint_state(node, monkeypatch):
    waits = watched(monkeypatch, node.context.monitor, "wait_for_state")
    code, text = cancelled(node, goal_of(node), waits.is_set)
    assert code == MoveItErrorCodes.PREEMPTED and "stopped on request" in text


def test_while_a_posture_of_the_goal_is_looked_for(node, standing, monkeypatch):
    # Anywhere in a large box, all of which the robot touches: postures are found and refused for ever.
    node.context.monitor.change(lambda scene: scene.with_object(WorldObject(
        "fog", pose_matrix((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), ((Box((4.0, 4.0, 0.9)), np.eye(4)),))), "test")
    up = joint_goal(SIX, (0.0, -1.5, 0.0, 0.0, 0.0, 0.0), 0.5)
    asked = watched(monkeypatch, node.context.exact, "contacts")
    code, text = cancelled(node, goal_of(node, *[up] * 200), asked.is_set)
    assert code == MoveItErrorCodes.PREEMPTED, text


def test_while_a_path_is_looked_for(node, standing, monkeypatch):
    # A wall from the axis of the first joint outwards: no way leads from one of its sides to the other.
    node.context.monitor.change(lambda scene: scene.with_object(WorldObject(
        "wall", pose_matrix((0.6, 0.6 * np.tan(0.65), 0.0), (0.0, 0.0, 0.65)), ((Box((1.4, 0.01, 5.0)), np.eye(4)),))),
        "test")
    searched = watched(monkeypatch, node.context.exact, "free")
    code, text = cancelled(node, goal_of(node), searched.is_set)
    assert code == MoveItErrorCodes.PREEMPTED, text


def test_while_the_trajectory_is_checked(node, standing, monkeypatch):
    timed = watched(monkeypatch, pipeline, "time_path")
    time_path = pipeline.time_path

    def timing(*values, **options):
        found = time_path(*values, **options)
        node.servers["move_group"].preempted.set()
        return found

    monkeypatch.setattr(pipeline, "time_path", timing)
    code, text = cancelled(node, goal_of(node), timed.is_set)
    assert code == MoveItErrorCodes.PREEMPTED, text


def test_while_it_moves(node):
    node.topics["joint_states"](joint_state())
    goal = goal_of(node, joint_goal(SIX, ASIDE), plan_only=False)
    goal.request.max_velocity_scaling_factor = 0.01
    server = node.servers["move_group"]
    server.feedback.clear()
    feeding = threading.Timer(0.1, lambda: node.topics["joint_states"](joint_state()))
    feeding.start()
    code, text = cancelled(node, goal, lambda: "MONITOR" in server.feedback and node.told(
        "~fake_controller_joint_states"))
    assert code == MoveItErrorCodes.PREEMPTED, text
    assert abs(node.context.monitor.joint_values()["j0"] - FREE[0]) < 0.5


def test_while_a_frame_is_waited_for(node, standing, monkeypatch):
    asked = watched(monkeypatch, node.context.monitor, "_listen_to_tf")
    place = PositionConstraint(link_name="l5")
    goal = goal_of(node)
    goal.request.goal_constraints[0].position_constraints = [framed(place, "nowhere")]
    code, _ = cancelled(node, goal, asked.is_set)
    assert code == MoveItErrorCodes.PREEMPTED


def test_a_diff_that_is_refused_ends_at_once(node, standing):
    goal = goal_of(node)
    goal.planning_options.planning_scene_diff = diff([box(SIX, "", 0.1, (0.0, 0.0, 9.0))])
    assert node.ask("move_group", goal)[1].error_code.val == MoveItErrorCodes.FAILURE
