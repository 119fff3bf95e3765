# SPDX-License-Identifier: BSD-3-Clause
"""Paths around a wall in the plane: free everywhere, out of a contact, and refused if there is none."""
import itertools

import numpy as np
import pytest

from baxter_tools.path_planner import ESCAPE_SLACK_M, NoFreePath, PathPlanner

LOWER, UPPER = (-1.0, -1.0), (1.0, 1.0)
MARGIN_M = 0.05
START, GOAL = (-0.8, 0.0), (0.8, 0.0)


def wall(point, top=0.5):
    """Distance to a wall on the y axis that is 0.2 thick and reaches from below up to `top`."""
    outside = np.array([abs(point[0]) - 0.1, point[1] - top])
    return float(np.hypot(*np.maximum(outside, 0.0)) + min(outside.max(), 0.0))


def least(way, clearance):
    return min(clearance(a + (b - a) * share) for a, b in itertools.pairwise(way) for share in np.linspace(0, 1, 200))


def planner(clearance=wall, seed=3):
    return PathPlanner(LOWER, UPPER, clearance, MARGIN_M, np.random.default_rng(seed))


def test_straight_where_nothing_is_in_the_way():
    assert len(planner().plan(START, (-0.5, 0.9))) == 2


@pytest.mark.parametrize("seed", range(10))
def test_around_the_wall_with_the_margin(seed):
    way = planner(seed=seed).plan(START, GOAL)
    np.testing.assert_array_equal(way[0], START)
    np.testing.assert_array_equal(way[-1], GOAL)
    assert least(way, wall) > MARGIN_M - 0.01  # looked at every 0.02
    assert len(way) <= 6


def test_by_way_of_a_given_posture():
    way = planner().plan(START, GOAL, via=[(0.0, -0.9), (0.0, 0.9)])
    assert [list(point) for point in way] == [[-0.8, 0.0], [0.0, 0.9], [0.8, 0.0]]


def test_the_same_numbers_give_the_same_way():
    ways = [planner(seed=5).plan(START, GOAL) for _ in range(2)]
    np.testing.assert_array_equal(ways[0], ways[1])


def test_out_of_a_touch_by_the_nearest_way():
    start = (-0.08, 0.0)
    way = planner().plan(start, GOAL)
    assert wall(way[1]) >= MARGIN_M
    assert least(way[:2], wall) >= wall(start) - ESCAPE_SLACK_M - 1e-9
    assert least(way[1:], wall) > MARGIN_M - 0.01


def test_goal_near_the_wall_lowers_the_margin_to_its_own():
    goal = (0.12, 0.0)
    way = planner().plan(START, goal)
    assert least(way, wall) > 0.9 * wall(np.array(goal)) - 0.005


def test_goal_inside_is_refused():
    with pytest.raises(NoFreePath, match="overlap by 100 mm"):
        planner().plan(START, (0.0, 0.0))


def test_closed_wall_is_refused():
    with pytest.raises(NoFreePath, match="no free way"):
        planner(lambda point: wall(point, top=2.0)).plan(START, GOAL)
