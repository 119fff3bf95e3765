# SPDX-License-Identifier: BSD-3-Clause
"""Grading of the exercise on steering, from synthetic traces: no simulator."""
import numpy as np
import pytest

from arm_kinematics import Chain, solve
from baxter_model import SIDES, joint_names, tip_of
from rf_checks.exercises import EXERCISES
from rf_checks.lab import robot_description
from rf_checks.recording import ProgramRun, RunRecording
from rf_checks.robot import JudgedRobot
from rf_checks.tasks_steering import ARM, SERVO, SteerTo
from urdf_model import parse_urdf
from urdf_model.transforms import axis_rotation

JOINTS = (*joint_names("left"), *joint_names("right"))
TASK = SteerTo()


@pytest.fixture(scope="module")
def robot():
    return JudgedRobot(robot_description())


@pytest.fixture(scope="module")
def chain():
    return Chain.from_robot(parse_urdf(robot_description()), base="base", tip=tip_of(ARM))


@pytest.fixture(params=[0, 1])
def call(request):
    return TASK.calls(np.random.default_rng(3))[request.param]


def run_of(chain, call, short=0.0, turn=0.0, node=SERVO, moves=True, enabled=True):
    """A ProgramRun in which the left gripper goes straight to its goal but for ``short`` [m], and turns about z by
    ``turn`` [rad]; ``node`` commands it."""
    q = np.array([call.posture[name] for name in JOINTS])
    pose = chain.fk(q[:7])
    way = np.array(call.expected) - pose[:3, 3]
    way *= 1.0 - short / np.linalg.norm(way)
    rows = [q.copy()]
    for share in np.linspace(0.0, 1.0, 40)[1:] if moves else ():
        there = pose.copy()
        there[:3, 3] += share * way
        there[:3, :3] = axis_rotation(np.array([0.0, 0.0, 1.0]), share * turn) @ pose[:3, :3]
        q[:7] = solve(chain, there, seed=q[:7]).q
        rows.append(q.copy())
    places = np.linspace(0.0, len(rows) - 1.0, 400)
    rows = np.stack([np.interp(places, range(len(rows)), column) for column in np.array(rows).T], axis=1)
    command = [ARM, 2, list(joint_names(ARM)), 7 * [0.1], node, True]
    records = [{"t": 0.01 * k, "q": row.tolist(), "enabled": enabled, "contacts": [], "held": {}, "ik": [],
                "commands": [command] if moves and k else [], "counts": dict.fromkeys(SIDES, k * moves),
                "accepted": dict.fromkeys(SIDES, k * moves), "placed": 0} for k, row in enumerate(rows)]
    return ProgramRun(list(call.arguments), RunRecording(JOINTS, records), exit_code=0)


def graded(call, run, robot):
    criteria = TASK.criteria(call, run, robot)
    assert sum(one.weight for one in criteria) == pytest.approx(100.0)
    fault = TASK.slip(call, run, robot)
    return sum(one.share * one.weight for one in criteria), fault.key if fault else None


def test_a_gripper_at_its_goal_gets_all_points(chain, call, robot):
    assert graded(call, run_of(chain, call), robot) == (pytest.approx(100.0), None)


@pytest.mark.parametrize(("change", "most", "key"), [
    ({"short": 0.03}, 80.0, "far_off"), ({"turn": 0.5}, 60.0, "turned"), ({"node": "/mine"}, 90.0, "not_steered"),
    ({"moves": False}, 0.0, "no_twist"), ({"moves": False, "enabled": False}, 0.0, None)])
def test_each_mistake_has_its_sentence(chain, call, robot, change, most, key):
    points, found = graded(call, run_of(chain, call, **change), robot)
    assert points <= most and found == key


def test_the_lab_has_a_servo_and_no_move_group(call):
    assert call.steered and call.obstacle is None
    steered = {one.name for one in EXERCISES if one.task.calls(np.random.default_rng(1))[0].steered}
    assert steered == {"steer_to"}
