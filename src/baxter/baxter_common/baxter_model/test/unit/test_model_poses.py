# SPDX-License-Identifier: BSD-3-Clause
"""The named poses against the values in the robot's documents."""
import pytest

import baxter_model
from baxter_model import PoseError, Poses, clamp_to_limits

PUBLISHED = {
    ("neutral", "left"): (0, -0.55, 0, 0.75, 0, 1.26, 0),
    ("neutral", "right"): (0, -0.55, 0, 0.75, 0, 1.26, 0),
    ("tucked", "left"): (-1.0, -2.07, 3.0, 2.55, 0, 0.01, 0),
    ("tucked", "right"): (1.0, -2.07, -3.0, 2.55, 0, 0.01, 0),
    ("untucked", "left"): (-0.08, -1.0, -1.19, 1.94, 0.67, 1.03, -0.50),
    ("untucked", "right"): (0.08, -1.0, 1.19, 1.94, -0.67, 1.03, 0.50),
    ("start", "left"): (0.192483, 1.047, 0.000806359, 0.491094, -0.178079, -0.0610333, -0.0124707),
    ("start", "right"): (-0.272659, 1.04701, -0.00123203, 0.49262, -0.0806423, -0.0620532, 0.0265941),
}
WHOLE = dict.fromkeys(baxter_model.JOINTS, 0.0)


@pytest.mark.parametrize("pose, side", PUBLISHED)
def test_published_angles(pose, side):
    names = baxter_model.joint_names(side)
    angles = baxter_model.poses().angles(pose, side)
    assert angles == dict(zip(names, PUBLISHED[pose, side], strict=True))
    assert tuple(angles) == names


def test_names():
    assert set(baxter_model.poses().names) == {"start", "neutral", "zero", "tucked", "untucked"}


def test_unknown_pose_lists_the_known_ones():
    with pytest.raises(PoseError, match="unknown pose 'tuck'; choices are start, neutral, zero, tucked, untucked"):
        baxter_model.poses().angles("tuck", "left")


def test_incomplete_pose_is_an_error():
    with pytest.raises(PoseError, match="pose 'half' gives s0; it must give s0, s1, e0"):
        Poses({"half": {"left": {"s0": 0.0}}})


def test_more_poses_leave_the_robots_own_as_they_are():
    table = {"wave": {"right": {**WHOLE, "s0": 1.0}}, "zero": {"left": {**WHOLE, "s0": 2}}}
    more = baxter_model.poses().extended(table)
    assert more.angles("wave", "left")["left_s0"] == -1.0
    assert more.angles("zero", "right")["right_s0"] == -2.0
    assert more.angles("neutral", "left") == baxter_model.poses().angles("neutral", "left")
    assert "wave" not in baxter_model.poses().names
    assert baxter_model.poses().angles("zero", "left")["left_s0"] == 0.0
    with pytest.raises(PoseError, match="pose 'half' gives s0"):
        more.extended({"half": {"left": {"s0": 0.0}}})


@pytest.mark.parametrize("side", baxter_model.SIDES)
def test_null_space_postures_are_the_named_ones_and_more(side):
    postures = baxter_model.null_space_postures(side)
    for name in ("neutral", "untucked", "tucked"):
        assert postures[name] == baxter_model.poses().angles(name, side)
    assert {"table_front", "forward", "aside", "overhead"} < set(postures)
    assert all(tuple(angles) == baxter_model.joint_names(side) for angles in postures.values())


def test_mirrored_twice_is_the_same():
    left = baxter_model.poses().angles("untucked", "left")
    posture = {name.removeprefix("left_"): angle for name, angle in left.items()}
    assert baxter_model.mirrored(baxter_model.mirrored(posture)) == posture
    assert baxter_model.arm_angles("left", posture) == left
    assert baxter_model.arm_angles("right", posture) == baxter_model.poses().angles("untucked", "right")


def test_clamped_to_limits():
    limits = {"right_s1": (-2.147, 1.047)}
    assert clamp_to_limits({"right_s1": 1.04701, "x": 9.0}, limits) == {"right_s1": 1.047, "x": 9.0}
