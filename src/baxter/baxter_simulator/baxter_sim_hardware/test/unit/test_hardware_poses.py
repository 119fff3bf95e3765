# SPDX-License-Identifier: BSD-3-Clause
"""The named poses against the figures that the robot's documents print."""
import pathlib

import pytest
import yaml

from baxter_sim_hardware import JOINT_SUFFIXES, PoseError, Poses, clamp_to_limits

FILE = pathlib.Path(__file__).parents[2] / "config" / "poses.yaml"
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


@pytest.fixture(scope="module")
def poses():
    return Poses(yaml.safe_load(FILE.read_text()))


@pytest.mark.parametrize("pose, side", PUBLISHED)
def test_published_angles(poses, pose, side):
    names = ["%s_%s" % (side, joint) for joint in JOINT_SUFFIXES]
    assert poses.angles(pose, side) == dict(zip(names, PUBLISHED[pose, side], strict=True))


def test_names(poses):
    assert set(poses.names) == {"start", "neutral", "zero", "tucked", "untucked"}


def test_unknown_pose_lists_the_known_ones(poses):
    with pytest.raises(PoseError, match="unknown pose 'tuck'; choices are start, neutral, zero, tucked, untucked"):
        poses.angles("tuck", "left")


def test_incomplete_pose_is_an_error():
    with pytest.raises(PoseError, match="pose 'half' gives s0; it must give s0, s1"):
        Poses({"mirror": {"s0": -1, "s1": 1}, "poses": {"half": {"left": {"s0": 0.0}}}})


def test_clamped_to_limits():
    limits = {"right_s1": (-2.147, 1.047)}
    assert clamp_to_limits({"right_s1": 1.04701, "x": 9.0}, limits) == {"right_s1": 1.047, "x": 9.0}
