# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of groups: poses are reached, refusals are heard, failures have reasons."""
import itertools

import numpy as np
import pytest

from motion_planning.kinematics import KinematicsFailure, NoIkSolution, fk, ik
from motion_planning.model import ModelError
from urdf_model.transforms import axis_rotation, rigid, rotation_angle


def assert_at(pose, expected, tolerance=1e-5):
    assert np.linalg.norm(pose[:3, 3] - expected[:3, 3]) < tolerance
    assert rotation_angle(pose[:3, :3].T @ expected[:3, :3]) < tolerance


@pytest.fixture(scope="module")
def base():
    """The root of the robot away from the origin of the planning frame, and turned."""
    return rigid(axis_rotation((0.0, 0.0, 1.0), 0.7), (1.0, -2.0, 0.5))


@pytest.mark.parametrize("side", ["left", "right"])
def test_random_poses_are_reached_within_limits(baxter, side, base):
    generator = np.random.default_rng(1)
    group, link = baxter.groups[side + "_arm"], side + "_gripper"
    start = baxter.state({}, base)
    others = [k for k in range(len(baxter.variables)) if k not in group.indices]
    for _ in range(20):
        pose = fk(baxter, generator.uniform(*baxter.bounds.T), [link], base)[link]
        q = ik(baxter, group.name, {link: pose}, start)
        assert_at(fk(baxter, q, [link], base)[link], pose)
        assert baxter.beyond_limits(q) == [] and (q[others] == start.q[others]).all()


def test_both_arms_at_once(baxter, base):
    generator = np.random.default_rng(2)
    start = baxter.state({}, base)
    for _ in range(5):
        poses = fk(baxter, generator.uniform(*baxter.bounds.T), ["left_gripper", "right_gripper"], base)
        reached = fk(baxter, ik(baxter, "both_arms", poses, start), list(poses), base)
        for link, pose in poses.items():
            assert_at(reached[link], pose)


def test_any_link_on_the_way_or_at_its_end(baxter):
    q = baxter.state(baxter.groups["left_arm"].states["left_neutral"]).q
    for link in ("left_wrist", "left_hand", "left_gripper_base"):
        pose = fk(baxter, q, [link])[link]
        found = ik(baxter, "left_arm", {link: pose}, baxter.default_state())
        assert_at(fk(baxter, found, [link])[link], pose)
    # The last joint does not move the forearm: it stays.
    found = ik(baxter, "left_arm", fk(baxter, q, ["left_lower_forearm"]),
               baxter.state({"left_w2": 0.3}))
    assert found[baxter.index["left_w2"]] == 0.3


def test_positions_alone(probot):
    goal = np.array((0.25, 0.1, 0.3))
    q = ik(probot, "manipulator", {"tool0": goal}, probot.default_state())
    assert np.linalg.norm(fk(probot, q, ["tool0"])["tool0"][:3, 3] - goal) < 1e-5


def test_what_is_out_of_reach_is_said(baxter):
    with pytest.raises(NoIkSolution, match="'left_gripper' cannot be put there: out of reach") as caught:
        ik(baxter, "left_arm", {"left_gripper": rigid(np.eye(3), (5.0, 0.0, 0.0))}, baxter.default_state())
    assert not caught.value.rejected


def test_refused_solutions_are_followed_by_others(baxter):
    q = baxter.state(baxter.groups["left_arm"].states["left_neutral"]).q
    pose = fk(baxter, q, ["left_gripper"])["left_gripper"]
    elbow = baxter.index["left_e0"]
    clock = itertools.count()

    def accept(candidate):
        return None if candidate[elbow] > 0.3 else "the elbow is at %.1f" % candidate[elbow]

    found = ik(baxter, "left_arm", {"left_gripper": pose}, baxter.state(q), 1e4, accept, lambda: next(clock))
    assert found[elbow] > 0.3
    assert_at(fk(baxter, found, ["left_gripper"])["left_gripper"], pose)
    with pytest.raises(NoIkSolution, match="refused, the nearest because it must not be") as caught:
        ik(baxter, "left_arm", {"left_gripper": pose}, baxter.state(q), 100.0, lambda q: "it must not be",
           lambda: next(clock))
    assert caught.value.rejected


@pytest.mark.parametrize("group, poses, words", [
    ("left_arm", {"nose": np.eye(4)}, "no link 'nose'"),
    ("left_arm", {"right_gripper": np.eye(4)}, "does not move link 'right_gripper'"),
    ("left_hand", {"left_gripper": np.eye(4)}, "does not move"),
    ("left_arm", {}, "no link"),
    ("left_arm", {"left_gripper": np.full((4, 4), np.nan)}, "cannot be used"),
    ("left_arm", {"left_gripper": np.zeros(7)}, "cannot be used"),
    ("both_arms", {"left_gripper": np.eye(4), "left_wrist": np.eye(4)}, "both hang on joint 'left_s0'"),
])
def test_questions_that_are_none(baxter, group, poses, words):
    with pytest.raises(KinematicsFailure, match=words):
        ik(baxter, group, poses, baxter.default_state())


def test_groups_and_links_that_are_not_there(baxter):
    with pytest.raises(ModelError, match="no group 'leg'"):
        ik(baxter, "leg", {"left_gripper": np.eye(4)}, baxter.default_state())
    with pytest.raises(ModelError, match="no link 'nose'"):
        fk(baxter, baxter.default_state().q, ["nose"])


def test_joints_of_others_in_between_are_named(mix):
    with pytest.raises(KinematicsFailure, match="moves joint 'push'|both hang on"):
        # The hand hangs on the arm: its finger cannot be put anywhere by the turret without the slide.
        from motion_planning.model import PlanningModel
        model = PlanningModel(mix.robot, type(mix.srdf)("mix", groups={"t": _group("t", "turn")}))
        ik(model, "t", {"slide": np.eye(4)}, model.default_state())


def _group(name, joint):
    from motion_planning.srdf import GroupEntry
    return GroupEntry(name, joints=(joint,))
