# SPDX-License-Identifier: BSD-3-Clause
"""Set-points between two steps: a hand keeps to its way, and bounds hold while joints brake at different rates."""
import sys
from pathlib import Path

import numpy as np
import pytest

from motion_planning.constraints.regions import rotation_vector
from moveit_servo import straight
from moveit_servo.limits import ServoLimits, ServoMotion
from moveit_servo.servo import ServoCommand
from moveit_servo.straight import StraightWay
from urdf_model.transforms import axis_rotation

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import DT, Driven, baxter_model  # noqa: E402


@pytest.fixture(scope="module")
def baxter():
    return baxter_model()


def off_its_way(model, seconds=1.0):
    """The greatest distance [m] of a hand from the line of a fast twist, from when it had come up to speed."""
    driven = Driven(model, "left_arm", {"left_s1": -1.0, "left_e1": 1.7, "left_w1": 0.8}, max_acceleration=10.0)
    twist, tips = np.array((-0.2, 0.2, 0.2, 0.0, -0.5, 0.8)), []
    for _ in range(round(seconds / DT)):
        driven.go(ServoCommand(twist=twist), DT)
        assert not driven.steps[-1].reason
        tips.append(driven.tip[:3, 3])
    way = np.array(tips[round(0.2 / DT):]) - tips[round(0.2 / DT)]
    line = twist[:3] / np.linalg.norm(twist[:3])
    return float(np.linalg.norm(way - np.outer(way @ line, line), axis=1).max())


def test_a_fast_twist_keeps_the_hand_on_its_way(baxter, monkeypatch):
    assert off_its_way(baxter) < 0.0002
    monkeypatch.setattr(straight, "_RETURN_RATE", 0.0)
    assert off_its_way(baxter) > 0.0005


def test_the_way_back_is_short_and_belongs_to_one_twist():
    way, twist, pose = StraightWay(), np.array((0.2, 0.0, 0.0, 0.0, 0.0, 0.0)), np.eye(4)
    for _ in range(40):
        pose[0, 3] += 0.2 * DT
        assert way.correction(pose.copy(), twist, DT) == pytest.approx(np.zeros(6), abs=1e-9)
    pose[1, 3], pose[:3, :3] = 0.001, axis_rotation(np.array((0.0, 0.0, 1.0)), 0.01)
    back = way.correction(pose.copy(), twist, DT)
    assert back[1] < 0.0 and back[5] < 0.0 and back[[0, 2, 3, 4]] == pytest.approx(np.zeros(4), abs=1e-3)
    pose[1, 3] = 0.5
    assert np.linalg.norm(way.correction(pose.copy(), twist, DT)[:3]) < 0.021, "a tenth of the twist"
    assert not way.correction(pose.copy(), -twist, DT).any(), "another twist, another way"


def test_a_turn_of_more_than_half_a_circle_is_one_way():
    way, twist = StraightWay(), np.array((0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    pose = np.eye(4)
    for number in range(600):
        pose[:3, :3] = axis_rotation(np.array((0.0, 0.0, 1.0)), number * DT)
        assert way.correction(pose.copy(), twist, DT) == pytest.approx(np.zeros(6), abs=1e-9)
    assert np.linalg.norm(rotation_vector(pose[:3, :3])) < 1.6 < 600 * DT


def test_a_joint_that_brakes_quickly_does_not_uncover_what_it_made_up_for():
    """Joint 0 moves towards something, joint 1 away from it as fast; both are to stop, and joint 1 could sooner."""
    limits = ServoLimits(np.full(2, -9.0), np.full(2, 9.0), np.full(2, 1.0), np.array((10.0, 40.0)),
                         np.array((600.0, 2400.0)))
    slope, least, worst = np.ones((1, 2)), np.zeros(1), {}
    for keeps in (False, True):
        motion = ServoMotion(np.zeros(2), limits)
        motion.velocity, speeds = np.array((-0.6, 0.6)), []
        for _ in range(20):
            motion.follow(np.zeros(2), DT, False, *((slope, least) if keeps else ()))
            speeds.append(float(slope[0] @ motion.velocity))
        assert np.abs(motion.velocity).max() < 1e-6
        worst[keeps] = min(speeds)
    assert worst[False] < -0.2 and worst[True] > -0.05
