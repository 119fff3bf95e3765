# SPDX-License-Identifier: BSD-3-Clause
"""Grading of each kind of exercise, from synthetic traces: no simulator."""
import itertools
import math

import numpy as np
import pytest

from baxter_model import SIDES, joint_names, poses
from rf_checks import mistakes, tasks, tasks_printed
from rf_checks.exercises import EXERCISES
from rf_checks.lab import robot_description
from rf_checks.recording import ProgramRun, RunRecording
from rf_checks.robot import JudgedRobot

# All joints that the simulated robot has.
OTHERS = ("head_pan", *("%s_gripper_%s_finger_joint" % pair for pair in itertools.product("lr", "lr")))
JOINTS = (*OTHERS, *joint_names("left"), *joint_names("right"))
# The same numbers on both arms.
NEUTRAL = tuple(poses().angles("neutral", "left").values())
POINT, QUATERNION = tasks.LAB_POINT, tasks.LAB_QUATERNION


@pytest.fixture(scope="module")
def robot():
    return JudgedRobot(robot_description())


def trace(left=((NEUTRAL,)), right=((NEUTRAL,)), seconds=2.0, ik=(), contacts=()):
    """A RunRecording in which each arm goes smoothly from posture to posture; requests and contacts come at the end."""
    count = round(seconds / 0.01)
    columns = [np.zeros((count, len(OTHERS)))]
    for postures in (left, right):
        postures = np.array(postures, dtype=float)
        place = np.linspace(0.0, len(postures) - 1.0, count)
        columns.append(np.stack([np.interp(place, range(len(postures)), postures[:, k]) for k in range(7)], axis=1))
    rows = np.hstack(columns)
    records = [{"t": 0.01 * k, "q": row.tolist(), "enabled": True, "contacts": [], "held": {}, "commands": [], "ik": [],
                "counts": dict.fromkeys(SIDES, k)} for k, row in enumerate(rows)]
    records[-1]["ik"], records[-1]["contacts"] = list(ik), list(contacts)
    return RunRecording(JOINTS, records)


def graded(task, call, run, robot):
    criteria = task.criteria(call, run, robot)
    assert sum(one.weight for one in criteria) == pytest.approx(100.0)
    fault = task.slip(call, run, robot)
    return sum(one.share * one.weight for one in criteria), fault.key if fault else None


def rotated(robot, rotation):
    """Postures that lead from neutral to the lab's point in an orientation (3, 3)."""
    return NEUTRAL, robot.solve("left", POINT, mistakes.quaternion_of(rotation))


def calls(task, seed=3):
    return task.calls(np.random.default_rng(seed))


@pytest.mark.parametrize("index", range(3))
def test_a_gripper_that_is_turned_gets_all_points(robot, index):
    task = tasks.RotateGripper()
    call = calls(task)[index]
    axis, angle = call.expected
    target = tasks.pose_matrix(POINT, QUATERNION)[:3, :3] @ mistakes.about(axis, angle)
    run = ProgramRun(list(call.arguments), trace(left=rotated(robot, target)), exit_code=0)
    assert graded(task, call, run, robot) == (pytest.approx(100.0), None)


def test_a_gripper_that_stays_gets_nothing(robot):
    task = tasks.RotateGripper()
    assert graded(task, calls(task)[0], ProgramRun([], trace(), exit_code=0), robot)[0] == 0.0


def test_a_gripper_at_its_place_but_not_turned_gets_the_place(robot):
    task = tasks.RotateGripper()
    start = tasks.pose_matrix(POINT, QUATERNION)[:3, :3]
    run = ProgramRun([], trace(left=rotated(robot, start)), exit_code=0)
    assert graded(task, calls(task)[0], run, robot) == (pytest.approx(20.0), "not_turned")


@pytest.mark.parametrize("key", ["quaternion_order", "degrees", "wrong_axis", "wrong_direction"])
def test_a_request_for_a_wrong_rotation_is_told_though_the_arm_cannot_follow(robot, key):
    task = tasks.RotateGripper()
    call = calls(task)[0]
    start = tasks.pose_matrix(POINT, QUATERNION)[:3, :3]
    wrong = next(rotation for found, _, rotation in mistakes.wrong_rotations(start, *call.expected) if found == key)
    ik = [["left", "base", list(POINT), mistakes.quaternion_of(wrong).tolist(), 1]]
    run = ProgramRun([], trace(left=rotated(robot, start), ik=ik), exit_code=0)
    assert graded(task, call, run, robot)[1] == key


def test_a_pose_in_another_frame_is_told(robot):
    task = tasks.RotateGripper()
    ik = [["left", "left_hand", list(POINT), list(QUATERNION), 0]]
    assert task.slip(calls(task)[0], ProgramRun([], trace(ik=ik)), robot).key == "wrong_frame"


def test_collisions_cost_their_points_and_no_others(robot):
    task = tasks.JointCommand()
    call = calls(task)[0]
    run = ProgramRun([], trace(right=(NEUTRAL, call.expected), contacts=[["right_hand", "torso"]]), exit_code=0)
    assert graded(task, call, run, robot)[0] == pytest.approx(85.0)


def waving(robot, side, periods=3, amplitude=0.08):
    sign = 1.0 if side == "left" else -1.0
    offsets = amplitude * np.sin(np.linspace(0.0, 2.0 * math.pi * periods, 24 * periods + 1))
    postures = []
    for offset in offsets:
        # Solved for the left arm and mirrored: both arms of this robot are each other's image.
        left = robot.solve("left", (0.6, 0.35 + sign * offset, 0.3), (0.0, 1.0, 0.0, 0.0))
        postures.append(np.array(left) * ((1, 1, 1, 1, 1, 1, 1) if side == "left" else (-1, 1, -1, 1, -1, 1, -1)))
    return postures


@pytest.mark.parametrize(("sides", "periods", "amplitude", "key"), [
    (SIDES, 3, 0.08, None), (("left",), 3, 0.08, "one_arm"), (SIDES, 2, 0.08, "too_short"),
    (SIDES, 3, 0.02, "too_small"),
])
def test_waves_are_graded(robot, sides, periods, amplitude, key):
    task = tasks.Wave()
    arms = {side: waving(robot, side, periods, amplitude) if side in sides else [NEUTRAL] for side in SIDES}
    points, found = graded(task, calls(task)[0], ProgramRun([], trace(**arms, seconds=4.0 * periods), exit_code=0),
                           robot)
    assert found == key
    assert points == pytest.approx(100.0, abs=1.0) if key is None else points < 95.0


PAIR = tasks.ProgramCall(("base", "left_hand"), {}, 10.0, (("base", "left_hand"),))


@pytest.mark.parametrize(("change", "points", "key"), [
    (lambda true: true, 100.0, None),
    (np.linalg.inv, 0.0, "wrong_frame"),
    (lambda true: np.eye(4), 0.0, "identity"),
    (lambda true: np.block([[true[:3, :3].T, true[:3, 3:]], [true[3:]]]), 0.0, "transposed"),
    (lambda true: np.block([[mistakes.rotation_of(*mistakes.quaternion_of(true[:3, :3])), true[:3, 3:]], [true[3:]]]),
     0.0, "quaternion_order"),
    (lambda true: true + np.array([[0, 0, 0, 0.2], *np.zeros((3, 4))]), 0.0, "wrong_numbers"),
])
def test_printed_matrices_are_graded(robot, change, points, key):
    task = tasks_printed.TfListener()
    recording = trace(left=((0.2, -0.4, 0.3, 0.8, -0.5, 1.1, 0.4),))
    true = robot.between("base", "left_hand", recording.joints_at(-1))
    run = ProgramRun([], recording, output=str(change(true).tolist()))
    assert graded(task, PAIR, run, robot) == (pytest.approx(points), key)


@pytest.mark.parametrize("pair", [("base", "head"), ("base", "left_gripper"), ("left_hand", "right_hand_camera")])
def test_another_pairs_matrix_with_the_sheets_slip_is_told_both(robot, pair):
    recording = trace(left=((0.2, -0.4, 0.3, 0.8, -0.5, 1.1, 0.4),))
    matrix = robot.between(*pair, recording.joints_at(-1))
    matrix[:3, :3] = mistakes.rotation_of(*mistakes.quaternion_of(matrix[:3, :3]))
    fault = tasks_printed.TfListener().slip(PAIR, ProgramRun([], recording, output=str(matrix.tolist())), robot)
    assert fault.key == "quaternion_order"
    assert all(words in fault.sentence for words in ("%s -> %s" % pair, "base -> left_hand", "quat = (q.x")), fault


def test_degrees_are_told_by_the_farthest_command():
    def commands(*angles):
        return [("right", 1, ["right_s0", "right_s1"], [0.1, angle]) for angle in angles]

    assert mistakes.command_slip(commands(0.5, 7.0, 57.3, 20.0)) == mistakes.command_slip(commands(9.0, 57.3))
    assert "right_s1 was commanded to 57.3" in mistakes.command_slip(commands(7.0, 57.3))[1]
    assert mistakes.command_slip(commands(3.0)) is None


def test_another_pairs_matrix_is_named(robot):
    task = tasks_printed.TfListener()
    recording = trace()
    other = robot.between("base", "left_gripper", recording.joints_at(-1))
    assert "base -> left_gripper" in task.slip(PAIR, ProgramRun([], recording, output=str(other.tolist())),
                                               robot).sentence


@pytest.mark.parametrize("seed", range(5))
def test_the_poses_of_the_unreachable_are_what_they_are_for(robot, seed):
    found = []
    for call in calls(tasks_printed.Unreachable(), seed):
        answer = robot.solve("left", call.expected[:3], call.expected[3:])
        found.append(answer.reason.name if hasattr(answer, "reason") else "SOLVED")
    assert found == ["SOLVED", "OUT_OF_REACH", "JOINT_LIMIT"]


@pytest.mark.parametrize(("output", "asked", "points", "key"), [
    ("JOINT_LIMIT: left_e1 by 0.1 rad", True, 100.0, None), ("JOINT_LIMIT", True, 70.0, None),
    ("JOINT_LIMIT: left_e1", False, 0.0, "made_up"), ("", False, 0.0, "not_asked"), ("no", True, 0.0, "no_verdict"),
    ("SOLVED OUT_OF_REACH JOINT_LIMIT left_e1", True, 0.0, None),
    ("JOINT_LIMIT: left_e1 or left_w1", True, 70.0, None), ("left_e1\nJOINT_LIMIT", True, 70.0, None),
])
def test_verdicts_are_graded(robot, output, asked, points, key):
    task = tasks_printed.Unreachable()
    call = calls(task)[2]
    ik = [["left", "base", list(call.expected[:3]), list(call.expected[3:]), 2]] if asked else []
    run = ProgramRun([], trace(ik=ik), output=output)
    assert graded(task, call, run, robot) == (pytest.approx(points), key)


@pytest.mark.parametrize(("output", "moves", "points", "key"), [
    ("reference frame: base\ncommanded frame: left_gripper", True, 100.0, None),
    ("reference frame: base\ncommanded frame: left_gripper", False, 35.0, "made_up"),
    ("reference frame: torso\ncommanded frame: left_gripper", True, 80.0, "wrong_frame"),
    ("reference frame: base\ncommanded frame: left_hand", True, 75.0, "wrong_frame"),
    ("", True, 55.0, "no_answer"),
])
def test_answers_about_frames_need_their_experiment(robot, output, moves, points, key):
    task = tasks_printed.IkFrame()
    there = robot.solve("left", POINT, QUATERNION)
    left = (NEUTRAL, there) if moves else (NEUTRAL,)
    run = ProgramRun([], trace(left=left, ik=[["left", "base", list(POINT), list(QUATERNION), 0]]), output=output)
    assert graded(task, calls(task)[0], run, robot) == (pytest.approx(points, abs=1.0), key)


@pytest.mark.parametrize(("line", "points"), [
    ("OUT_OF_REACH: %.4f m and 0.0000 rad short", 100.0), ("OUT_OF_REACH %.3f 0.0", 100.0), ("%.3f OUT_OF_REACH", 70.0),
    ("OUT_OF_REACH: (1.5 0.6 0.2) is at least %.2f m beyond the arm", 100.0),
    ("OUT_OF_REACH 0.1 0.2 0.3 %.3f 0.5 0.6", 70.0), ("OUT_OF_REACH 1e999 %.3f", 100.0),
])
def test_how_far_short_a_pose_is_is_one_number(robot, line, points):
    task = tasks_printed.Unreachable()
    call = calls(task)[1]
    failure = robot.solve("left", call.expected[:3], call.expected[3:])
    ik = [["left", "base", list(call.expected[:3]), list(call.expected[3:]), 1]]
    run = ProgramRun([], trace(ik=ik), output=line % failure.residual_m)
    assert graded(task, call, run, robot)[0] == pytest.approx(points)


def everything(robot, joints):
    """All that a program could print without an idea of its exercise."""
    frames = [name for name in tasks_printed.FRAMES if name in robot.frame_names]
    lines = ["%s -> %s\n%s" % (*pair, robot.between(*pair, joints).tolist())
             for pair in itertools.permutations(frames, 2)]
    lines += ["reference frame: %s\ncommanded frame: %s" % (frame, frame) for frame in frames]
    numbers = ["%.2f" % (0.01 * k) for k in range(300)]
    words = " ".join([*joints, *numbers, *("%s m" % number for number in numbers)])
    lines += [words, *tasks_printed.VERDICTS, *("%s: %s" % (one, words) for one in tasks_printed.VERDICTS[:3])]
    return "\n".join(lines)


@pytest.mark.parametrize("exercise", EXERCISES, ids=lambda one: one.name)
def test_a_program_that_prints_everything_answers_nothing(robot, exercise):
    recording = trace(left=((0.2, -0.4, 0.3, 0.8, -0.5, 1.1, 0.4),))
    output = everything(robot, recording.joints_at(-1))
    for call in calls(exercise.task):
        if isinstance(exercise.task, tasks_printed.Unreachable):
            ik = [["left", "base", list(call.expected[:3]), list(call.expected[3:]), 1]]
            recording = trace(ik=ik)
        criteria = exercise.task.criteria(call, ProgramRun(list(call.arguments), recording, output=output), robot)
        points = {one.name: one.share * one.weight for one in criteria}
        # One verdict of three is right by chance, without its reason.
        assert all(value == 0.0 for name, value in points.items() if name != "verdict"), (call.arguments, points)
        assert points.get("reason", 0.0) == 0.0


def test_what_is_printed_again_and_again_is_one_answer(robot):
    recording = trace(left=((0.2, -0.4, 0.3, 0.8, -0.5, 1.1, 0.4),))
    found = [str(robot.between(*pair, recording.joints_at(-1)).tolist()) for pair in tasks_printed.SHEET_PAIRS]
    call, one = calls(tasks_printed.TfListener())
    run = ProgramRun([], recording, output="\n".join([*found, *found, *found[:2]]))
    assert graded(tasks_printed.TfListener(), call, run, robot) == (pytest.approx(100.0), None)
    # The others came first, the asked one last; then the other way round.
    right = str(robot.between(*one.expected[0], recording.joints_at(-1)).tolist())
    for output, expected in (([*found, right], (pytest.approx(100.0), None)), ([right, *found], (0.0, "too_many"))):
        run = ProgramRun([], recording, output="\n".join(output))
        assert graded(tasks_printed.TfListener(), one, run, robot) == expected


@pytest.mark.parametrize("number", ["1e999", "-1e400", "9" * 5000])
def test_numbers_beyond_all_bounds_are_no_matrix(number):
    assert tasks_printed.matrices("[[%s, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]" % number) == []


@pytest.mark.parametrize(("halts", "words"), [(0, "smoothly"), (1, "smoothly"), (2, "2 times")])
def test_full_points_for_smoothness_come_without_a_reproach(robot, halts, words):
    task = tasks.JointCommand()
    call = calls(task)[0]
    path = [NEUTRAL]
    for part in np.linspace(0.0, 1.0, halts + 2)[1:]:
        step = np.array(NEUTRAL) + part * (np.array(call.expected) - NEUTRAL)
        path += [step, step]
    smooth = next(one for one in task.criteria(call, ProgramRun([], trace(right=path, seconds=6.0), exit_code=0), robot)
                  if one.name == "smoothness")
    assert words in smooth.found and (smooth.share == 1.0) == (halts < 2), smooth
