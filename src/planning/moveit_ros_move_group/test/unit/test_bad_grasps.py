# SPDX-License-Identifier: BSD-3-Clause
"""Goals of pickup, place and sequences that are spoiled or cancelled: each ends, with a code and one sentence."""
import random
import re
import sys
import threading
from pathlib import Path

import pytest
from moveit_msgs.msg import MoveItErrorCodes

from lab_testing.waiting import wait_until

sys.path.insert(0, str(Path(__file__).parents[1]))
import handed_arm  # noqa: E402
from bad_requests import KNOWN_CODES, spoiled  # noqa: E402
from good_requests import diff, nothing_left  # noqa: E402
from handed_arm import good_goals  # noqa: E402
from in_process import Node  # noqa: E402

ACTIONS = sorted(good_goals())
TIMEOUT_S, ALLOWED_S = 60.0, 600.0


@pytest.fixture(scope="module")
def node():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("moveit_ros_move_group.capabilities.pick_place._STATE_TIMEOUT_S", TIMEOUT_S)
        patch.setattr("moveit_ros_move_group.capabilities.sequence._STATE_TIMEOUT_S", TIMEOUT_S)
        node = Node(patch, handed_arm.parameters("interpolate"))
        yield node


@pytest.fixture
def standing(node):
    with node.hearing("joint_states", handed_arm.joint_state):
        yield


def prepare(node, action):
    for scene in nothing_left():
        node.context.monitor.apply(scene, "nothing_left")
    held = action == "place"
    node.context.monitor.apply(diff((), [handed_arm.held()]) if held else diff([handed_arm.thing()]), "test")
    node.published.clear()
    node.logged.clear()


def planned(action):
    goal = good_goals()[action]
    goal.planning_options.plan_only = True
    return goal


def code_of(answer):
    result = answer[1]
    return getattr(result, "response", result).error_code.val


def limit_time(goal, seconds):
    for one in (goal, *(item.req for item in getattr(getattr(goal, "request", None), "items", ()))):
        if hasattr(one, "allowed_planning_time"):
            one.allowed_planning_time = seconds


@pytest.mark.parametrize("action", ACTIONS)
def test_good_goals_succeed(node, standing, action):
    prepare(node, action)
    answer = node.ask(action, planned(action))
    assert code_of(answer) == MoveItErrorCodes.SUCCESS, answer[2]
    assert not node.told("~failures")


@pytest.mark.parametrize("action", ACTIONS)
def test_spoiled_goals_end_with_a_code_and_a_sentence(node, standing, action):
    flaws = []
    for seed in range(40):
        goal, what = spoiled(planned(action), random.Random(seed))
        limit_time(goal, 0.5)
        prepare(node, action)
        answer = node.ask(action, goal)
        code, told = code_of(answer), [one.text for one in node.told("~failures")]
        wrong = code not in KNOWN_CODES or (code != MoveItErrorCodes.SUCCESS) != (len(told) == 1)
        wrong = wrong or any(not text or "\n" in text or text.endswith("None") for text in told)
        wrong = wrong or any(re.search(r"\b[A-Z]\w+(Error|Exception): ", line) for line in [*node.logged, answer[2]])
        if wrong:
            flaws.append((seed, what, code, answer[2], told))
    assert not flaws


def cancelled(node, action, goal, when):
    """(code, text) of a goal that is cancelled once ``when()``."""
    server, answer = node.servers[action], []
    thread = threading.Thread(target=lambda: answer.append(server.ask(goal)), daemon=True)
    thread.start()
    try:
        wait_until(when, "the phase to come", TIMEOUT_S)
        server.preempted.set()
        thread.join(TIMEOUT_S)
    finally:
        server.preempted.clear()
    assert answer, "a cancelled goal goes on"
    return code_of(answer[0]), answer[0][2]


def called(patch, owner, name):
    """An Event that is set when a function is called."""
    function, event = getattr(owner, name), threading.Event()
    patch.setattr(owner, name, lambda *values, **options: event.set() or function(*values, **options))
    return event


@pytest.mark.parametrize("action", ACTIONS)
def test_cancelled_while_a_joint_state_is_waited_for(node, monkeypatch, action):
    prepare(node, action)
    waits = called(monkeypatch, node.context.monitor, "wait_for_state")
    code, text = cancelled(node, action, planned(action), waits.is_set)
    assert code == MoveItErrorCodes.PREEMPTED, text


@pytest.mark.parametrize("action", ACTIONS)
def test_cancelled_while_it_plans(node, standing, monkeypatch, action):
    prepare(node, action)
    goal = planned(action)
    limit_time(goal, ALLOWED_S)
    # As many as are never all tried before it is cancelled.
    if action == "pickup":
        goal.possible_grasps *= 500
    elif action == "place":
        goal.place_locations *= 500
    else:
        goal.request.items *= 500
    monkeypatch.setattr(node.context.exact, "free", lambda *_: False)
    asked = called(monkeypatch, node.context.exact, "contacts")
    looked = called(monkeypatch, node.context.exact, "first_blocked")
    code, text = cancelled(node, action, goal, lambda: asked.is_set() or looked.is_set())
    assert code == MoveItErrorCodes.PREEMPTED, text


@pytest.mark.parametrize("action", ACTIONS)
def test_cancelled_while_it_moves(node, action):
    prepare(node, action)
    with node.hearing("joint_states", handed_arm.joint_state):
        wait_until(lambda: not node.context.monitor.missing_joints(), "the joints", TIMEOUT_S)
    goal = good_goals()[action]
    server = node.servers[action]
    server.feedback.clear()
    feeding = threading.Timer(0.1, lambda: node.topics["joint_states"](handed_arm.joint_state()))
    feeding.start()
    code, text = cancelled(node, action, goal, lambda: "MONITOR" in server.feedback and node.told(
        "~fake_controller_joint_states"))
    assert code == MoveItErrorCodes.PREEMPTED, text
