# SPDX-License-Identifier: BSD-3-Clause
"""The objects on the table for a seed, and how a block among them can be grasped."""
import itertools
import math

import numpy as np
import pytest

from baxter_sim_examples import BASE_HEIGHT_M, BLOCK_SIZE_M, TABLE_TOP_M, Spot, Trial
from baxter_sim_examples.clutter import THINGS, clutter, grasps, held_otherwise, landings, lean_of
from urdf_model import parse_urdf
from urdf_model.transforms import matrix_from_quaternion

SEEDS = range(100)


def test_a_seed_always_means_the_same():
    assert clutter(5) == clutter(5) != clutter(6)


@pytest.mark.parametrize("seed", SEEDS)
def test_things_stand_on_the_table_and_clear_of_each_other(seed):
    things, trial = clutter(seed), Trial.from_seed(seed)
    assert len(things) == THINGS == len({thing.name for thing in things})
    block = BLOCK_SIZE_M / math.sqrt(2.0)
    circles = [(thing.spot, thing.radius) for thing in things] + [(trial.source, block), (trial.target, block)]
    for (a, a_radius), (b, b_radius) in itertools.combinations(circles, 2):
        if {a, b} != {trial.source, trial.target}:
            assert math.hypot(a.x - b.x, a.y - b.y) > a_radius + b_radius + 0.019
    for thing in things:
        assert thing.spot.z - 0.5 * thing.height == pytest.approx(TABLE_TOP_M - BASE_HEIGHT_M)


def test_a_planner_is_told_of_larger_things_at_the_same_places():
    """Paths that it finds lead past what it knows of at next to no distance."""
    for thing in clutter(0):
        told = thing.with_margin()
        assert told.spot == thing.spot and told.is_round == thing.is_round
        assert told.width == pytest.approx(thing.width + 0.01) and told.height == pytest.approx(thing.height + 0.01)


def test_descriptions_can_be_read():
    kinds = set()
    for thing in clutter(0) + clutter(1):
        (link,) = parse_urdf(thing.urdf(), source=thing.name).links.values()
        kinds.add(type(link.collisions[0].geometry).__name__)
    assert kinds == {"Box", "Cylinder"}


def test_hands_look_down_with_their_fingers_along_the_blocks_faces():
    spot = Spot(0.7, 0.1, -0.13, 2.3)
    found = grasps(spot)
    assert len({grasp.orientation for grasp in found}) == len(found) == 44
    faces = [np.array((math.cos(spot.yaw + k * math.pi / 2.0), math.sin(spot.yaw + k * math.pi / 2.0), 0.0))
             for k in range(4)]
    for grasp in found:
        turn = matrix_from_quaternion(np.array(grasp.orientation))
        assert turn[2, 2] < -math.cos(0.66), "it looks down"
        assert max(turn[:, 1] @ face for face in faces) == pytest.approx(1.0), "fingers close along y"
    best = max(found, key=lambda grasp: grasp.quality)
    assert matrix_from_quaternion(np.array(best.orientation))[2, 2] == pytest.approx(-1.0)


def test_other_grasps_are_those_that_lean_otherwise():
    found = grasps(Spot(0.7, 0.1, -0.13, 2.3))
    leans = [round(lean_of(grasp.orientation), 6) for grasp in found]
    assert sorted(leans) == [0.0] * 4 + sorted([0.1, 0.2, 0.35, 0.5, 0.65] * 8)
    upright, leaning = found[leans.index(0.0)], found[leans.index(0.35)]
    for hand, others in ((upright, {0.1, 0.2, 0.35, 0.5, 0.65}), (leaning, {0.0, 0.1, 0.2, 0.5, 0.65})):
        assert {round(lean_of(one.orientation), 6) for one in held_otherwise(found, hand.orientation)} == others
    # A hand that is on its way there is a little off.
    x, y, z, w = upright.orientation
    assert len(held_otherwise(found, (x, y, z + 0.01, w + 0.01))) == 40


def test_a_block_lands_on_its_target_turned_by_quarters():
    spot = Spot(0.7, 0.1, -0.13, 0.4)
    assert [(round(one.yaw - 0.4, 6), one.x, one.y) for one in landings(spot)] == [
        (round(k * math.pi / 2.0, 6), 0.7, 0.1) for k in range(4)]
