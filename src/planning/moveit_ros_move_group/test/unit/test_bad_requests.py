# SPDX-License-Identifier: BSD-3-Clause
"""Bad requests are refused in one sentence each, and the node goes on; no ROS around it."""
import re
import sys
import threading
from pathlib import Path

import pytest
from moveit_msgs.msg import MoveItErrorCodes

from lab_testing.waiting import wait_until
from motion_planning.scene import Scene
from moveit_ros_move_group.convert.geometry import matrix_of, pose_of

sys.path.insert(0, str(Path(__file__).parents[1]))
from bad_requests import cases, flaws_of, outcome  # noqa: E402
from good_requests import good_requests, many_objects, nothing_left, pose  # noqa: E402
from in_process import Node  # noqa: E402
from small_arm import SIX, joint_state, parameters  # noqa: E402


@pytest.fixture(scope="module")
def node():
    with pytest.MonkeyPatch.context() as patch:
        yield Node(patch, parameters())


@pytest.fixture(autouse=True)
def empty(node):
    node.published.clear()
    yield
    for scene in nothing_left():
        node.context.monitor.apply(scene, "nothing_left")


@pytest.fixture(scope="module", autouse=True)
def joint_states(node):
    """The arm stands still, and says so."""
    with node.hearing("joint_states", joint_state):
        yield


def failures(node):
    return node.told("~failures")


@pytest.mark.parametrize("endpoint", sorted(good_requests(SIX)))
def test_good_requests_succeed(node, endpoint):
    code, text = outcome(node.ask(endpoint, good_requests(SIX)[endpoint]))
    assert code in (None, MoveItErrorCodes.SUCCESS), text
    assert not failures(node)


def test_poses_of_what_is_held_and_of_its_subframes_are_solved(node):
    """A subframe 0.1 m in front of the tip: where it is, the tip is 0.1 m behind."""
    held = good_requests(SIX)["attached_collision_object"]
    held.object.header.frame_id = SIX.tip
    held.object.subframe_names, held.object.subframe_poses = ["end"], [pose(0.0, 0.0, 0.1)]
    node.ask("attached_collision_object", held)
    request = good_requests(SIX)["compute_ik"]
    tip = node.ask("compute_ik", request)
    ahead = matrix_of(request.ik_request.pose_stamped.pose) @ matrix_of(pose(0.0, 0.0, 0.1))
    for link, there in (("held", request.ik_request.pose_stamped.pose), ("held/end", pose_of(ahead))):
        request.ik_request.ik_link_name, request.ik_request.pose_stamped.pose = link, there
        found = node.ask("compute_ik", request)
        assert found.error_code.val == MoveItErrorCodes.SUCCESS
        for one, other in zip(found.solution.joint_state.position, tip.solution.joint_state.position, strict=True):
            assert abs(one - other) < 1e-3
    request.ik_request.ik_link_name = "held/nothing"
    assert node.ask("compute_ik", request).error_code.val == MoveItErrorCodes.INVALID_LINK_NAME


def asked(node, case):
    """Flaws of the answer to a Case, as one text; empty where all is as it should be."""
    node.published.clear()
    node.logged.clear()
    code, text = outcome(node.ask(case.endpoint, case.message))
    told = failures(node)
    flaws = flaws_of(case, code, [one.text for one in told])
    if code is None and case.says and not told:
        flaws.append("no failure was told")
    flaws += ["an exception: %s" % line for line in node.logged if re.search(r"\b[A-Z]\w+(Error|Exception): ", line)]
    return "; ".join("%s (%s, %s): %s" % (case.name[:80], code, text[:80], flaw) for flaw in flaws)


CASES = cases(SIX, 1, 1000)


@pytest.mark.parametrize("part", range(10))
def test_bad_requests_are_refused_in_a_sentence(node, part):
    wrong = []
    for case in CASES[part::10]:
        wrong.append(asked(node, case))
        for scene in nothing_left():
            node.context.monitor.apply(scene, "nothing_left")
    assert not list(filter(None, wrong))
    assert outcome(node.ask("plan_kinematic_path", good_requests(SIX)["plan_kinematic_path"]))[0] == 1


def test_the_same_seed_gives_the_same_requests():
    first, again = cases(SIX, 7, 400), cases(SIX, 7, 400)
    assert [(one.name, str(one.message)) for one in first] == [(one.name, str(one.message)) for one in again]
    assert [one.name for one in first] != [one.name for one in cases(SIX, 8, 400)]


def test_thousands_of_objects_come_and_go_together(node):
    request, with_objects, together = many_objects(SIX, 20000), Scene.with_objects, []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "with_objects",
                      lambda scene, new: together.append(len(new)) or with_objects(scene, new))
        assert node.ask("apply_planning_scene", request).success
    assert together == [20000]  # one by one it takes hours: each makes a new scene
    assert len(node.context.monitor.scene().objects) == 20000
    assert outcome(node.ask("plan_kinematic_path", good_requests(SIX)["plan_kinematic_path"]))[0] == 1
    for one in request.scene.world.collision_objects:
        one.operation = one.REMOVE
    assert node.ask("apply_planning_scene", request).success
    assert not node.context.monitor.scene().objects
    assert not node.ask("apply_planning_scene", request).success
    assert len(failures(node)) <= 11
    assert "more of this message" in failures(node)[-1].text


def test_joint_states_come_in_while_a_large_scene_is_read(node):
    """A change of the scene takes its time; nothing else waits for it."""
    reading, go_on = threading.Event(), threading.Event()

    def slow(scene):
        reading.set()
        assert go_on.wait(60.0)
        return scene

    thread = threading.Thread(target=lambda: node.context.monitor.change(slow, "test"), daemon=True)
    thread.start()
    assert reading.wait(60.0)
    before = node.context.monitor.joint_update()[0]
    wait_until(lambda: node.context.monitor.joint_update()[0] >= before + 3, "three joint states", 60.0)
    assert node.context.monitor.scene() is not None
    go_on.set()
    thread.join(60.0)


def test_a_cancelled_goal_is_preempted_before_it_is_planned(node):
    server = node.servers["move_group"]
    server.preempted.set()
    try:
        code, text = outcome(node.ask("move_group", good_requests(SIX)["move_group"]))
    finally:
        server.preempted.clear()
    assert code == MoveItErrorCodes.PREEMPTED
    assert "stopped on request" in text


def test_replanning_fewer_times_than_none_is_none(node):
    goal = good_requests(SIX)["move_group"]
    goal.planning_options.plan_only, goal.planning_options.replan = False, True
    goal.planning_options.replan_attempts = -7
    goal.request.goal_constraints = good_requests(SIX)["check_state_validity"].constraints,
    assert outcome(node.ask("move_group", goal))[0] == MoveItErrorCodes.SUCCESS
