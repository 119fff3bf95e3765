# SPDX-License-Identifier: BSD-3-Clause
"""Grading of the exercise on planning, from synthetic traces: no simulator."""
import numpy as np
import pytest

from baxter_model import SIDES, joint_names
from rf_checks import diagnosis
from rf_checks.exercises import EXERCISES
from rf_checks.recording import ProgramRun, RunRecording
from rf_checks.tasks_planning import PlanAround
from urdf_model.transforms import rpy_matrix

JOINTS = (*joint_names("left"), *joint_names("right"))
TASK = PlanAround()


@pytest.fixture
def call():
    call, = TASK.calls(np.random.default_rng(3))
    return call


def run_of(call, boxes=(), moves=True, end=None, contacts=()):
    """A ProgramRun whose left arm goes smoothly to `end`, or stays; boxes: (pose, edges) that move_group was told
    of."""
    begin = np.array([call.posture[name] for name in JOINTS])
    goal = begin.copy()
    if moves:
        goal[:7] = call.expected.goal if end is None else end
    records = []
    for k in range(200):
        share = k / 199
        records.append({"t": 0.01 * k, "q": (begin + share * (goal - begin)).tolist(), "enabled": True, "contacts": [],
                        "held": {}, "commands": [], "ik": [], "counts": dict.fromkeys(SIDES, k * moves),
                        "accepted": dict.fromkeys(SIDES, k * moves), "placed": 0})
    records[0]["scene"] = [["thing", pose.ravel().tolist(), list(edges)] for pose, edges in boxes]
    records[150]["contacts"] = [list(pair) for pair in contacts]
    return ProgramRun(list(call.arguments), RunRecording(JOINTS, records), exit_code=0)


def box_of(pillar, offset=(0.0, 0.0, 0.0), scale=1.0, margin=0.0):
    pose = np.eye(4)
    pose[:3, 3] = np.array(pillar.middle) + offset
    return pose, scale * np.array(pillar.edges) + 2.0 * margin


def graded(call, run):
    criteria = TASK.criteria(call, run, None)
    assert sum(one.weight for one in criteria) == pytest.approx(100.0)
    fault = TASK.slip(call, run, None)
    return sum(one.share * one.weight for one in criteria), fault.key if fault else None


def test_a_scene_full_of_boxes_knows_no_pillar(call):
    boxes = [box_of(call.obstacle, offset=(0.05 * k, 0.0, 0.0)) for k in range(-10, 11)]
    run = run_of(call, boxes)
    shares = {one.name: one.share for one in TASK.criteria(call, run, None)}
    assert shares["the pillar in the scene"] == 0.0 and TASK.slip(call, run, None).key == "too_many_boxes"


@pytest.mark.parametrize("margin", [0.0, 0.03, 0.05])
def test_past_the_pillar_gets_all_points(call, margin):
    assert graded(call, run_of(call, [box_of(call.obstacle, margin=margin)])) == (pytest.approx(100.0), None)


HIT = [("left_wrist", "pillar/pillar")]


@pytest.mark.parametrize(("change", "points", "key", "words"), [
    ({"boxes": ()}, 80.0, "no_box", "was told of no box"),
    ({"boxes": (), "contacts": HIT}, 60.0, "no_box", "the arm ran into it"),
    ({"scale": 0.5, "contacts": HIT}, 60.0, "half_size", "half of the pillar's"),
    ({"scale": 1.3}, 80.0, "box_size", "at most 0.06 m"),
    ({"offset": (0.0, 0.0, 0.59), "contacts": HIT}, 60.0, "box_elsewhere", "0.59 m from where the pillar stands"),
    ({"moves": False}, 20.0, "not_executed", "plan() only looks"),
    ({"end": (0.3, *6 * (0.0,))}, 20.0, "far_off", "set_named_target"),
    ({"contacts": HIT}, 80.0, None, ""),
])
def test_each_mistake_has_its_sentence(call, change, points, key, words):
    box = box_of(call.obstacle, change.get("offset", (0.0, 0.0, 0.0)), change.get("scale", 1.0))
    run = run_of(call, change.get("boxes", [box]), change.get("moves", True), change.get("end"),
                 change.get("contacts", ()))
    assert graded(call, run) == (pytest.approx(points), key)
    assert words in getattr(TASK.slip(call, run, None), "sentence", "")


def test_an_arm_that_the_pillar_stops_is_no_program_that_left_too_early(call):
    run = run_of(call, (), contacts=HIT)
    run.recording.records[-1]["exited"] = 0.5
    exercise, = (one for one in EXERCISES if one.task.__class__ is PlanAround)
    assert diagnosis.diagnose(run, exercise, call, None, 0.0).key == "no_box"
    # Without contact it did leave too early.
    free = run_of(call, [box_of(call.obstacle)])
    free.recording.records[-1]["exited"] = 0.5
    assert diagnosis.diagnose(free, exercise, call, None, 0.5).key == "early_exit"


def test_a_box_that_is_told_after_the_motion_counts_for_nothing(call):
    run = run_of(call, ())
    late = run.recording.records + [{**run.recording.records[-1], "t": 2.0 + 0.01 * k} for k in range(10)]
    pose, edges = box_of(call.obstacle)
    late[-1] = {**late[-1], "scene": [["thing", pose.ravel().tolist(), edges.tolist()]]}
    run.recording = RunRecording(JOINTS, late)
    assert graded(call, run)[1] == "no_box"


def test_a_box_may_be_turned_if_it_covers_the_same(call):
    pose, edges = box_of(call.obstacle)
    for angle, covered in ((np.pi / 2.0, True), (np.pi / 4.0, False)):
        turned = pose.copy()
        turned[:3, :3] = rpy_matrix(0.0, 0.0, angle)
        # Turned by an eighth, a square of the same size leaves the corners out.
        assert call.obstacle.is_covered(turned, edges) == covered


def test_the_straight_way_leads_through_the_pillar(call):
    """Otherwise the exercise asks for nothing."""
    from rf_checks.lab import robot_description
    from rf_checks.robot import JudgedRobot

    robot = JudgedRobot(robot_description())
    begin = np.array([call.posture[name] for name in joint_names("left")])
    way = [begin + share * (np.array(call.expected.goal) - begin) for share in np.linspace(0.0, 1.0, 100)]
    points = np.array([robot.frame("left_gripper", dict(zip(joint_names("left"), q, strict=True)))[:3, 3] for q in way])
    inside = (np.abs(points - call.obstacle.middle) < 0.5 * np.array(call.obstacle.edges)).all(axis=1)
    assert inside.any() and not inside[0] and not inside[-1]
