# SPDX-License-Identifier: BSD-3-Clause
"""Paths of Baxter's arms into and out of the folded pose: free of contact, checked in small steps."""
import itertools

import numpy as np
import pytest
import rospkg

import baxter_model
import xacro
from baxter_model import SIDES
from baxter_tools.path_planner import PathPlanner
from baxter_tools.self_clearance import SelfClearance

MARGIN_M = 0.01
NAMES = [name for side in SIDES for name in baxter_model.joint_names(side)]


@pytest.fixture(scope="module")
def packages():
    return rospkg.RosPack()


@pytest.fixture(scope="module")
def clearance(packages):
    urdf = xacro.process_file(packages.get_path("baxter_description") + "/urdf/baxter.urdf.xacro").toxml()
    clearance = SelfClearance(urdf, NAMES)
    yield clearance
    clearance.close()


@pytest.fixture(scope="module")
def poses():
    def posture(name):
        angles = {joint: angle for side in SIDES for joint, angle in baxter_model.poses().angles(name, side).items()}
        return np.array([angles[joint] for joint in NAMES])

    return posture


def least(way, clearance):
    return min(clearance(a + (b - a) * share) for a, b in itertools.pairwise(way) for share in np.linspace(0, 1, 300))


def plan(clearance, poses, start, pose):
    planner = PathPlanner(clearance.lower, clearance.upper, clearance, MARGIN_M, np.random.default_rng(1))
    return planner.plan(start, poses(pose), via=[poses("untucked"), poses("neutral")])


def test_folded_and_unfolded_arms_and_the_straight_way_between_them_are_clear(clearance, poses):
    """Of the head itself, not of the field around it: the vendor's program takes that path with the field
    suppressed."""
    assert least([poses("untucked"), poses("tucked")], clearance) > MARGIN_M


def test_arms_that_cross_hit_each_other(clearance, poses):
    crossed = np.zeros(14)
    crossed[[0, 7]] = -1.5, 1.5
    assert least([poses("untucked"), crossed], clearance) < 0.0


@pytest.mark.parametrize(("start", "end"), [("start", "tucked"), ("untucked", "tucked"), ("neutral", "tucked"),
                                            ("tucked", "untucked"), ("start", "untucked")])
def test_way_between_named_poses_is_free(clearance, poses, start, end):
    way = plan(clearance, poses, poses(start), end)
    np.testing.assert_array_equal(way[-1], poses(end))
    assert least(way, clearance) > 0.003


def check_random(clearance, poses, count, seed):
    rng = np.random.default_rng(seed)
    done = 0
    while done < count:
        start = rng.uniform(clearance.lower, clearance.upper)
        if clearance(start) > 0.0:
            for pose in ("tucked", "untucked"):
                assert least(plan(clearance, poses, start, pose), clearance) > min(0.003, 0.5 * clearance(start)), start
            done += 1


def test_way_from_random_postures_is_free(clearance, poses):
    check_random(clearance, poses, 2, seed=7)


@pytest.mark.long
def test_way_from_many_random_postures_is_free(clearance, poses):
    check_random(clearance, poses, 100, seed=8)
