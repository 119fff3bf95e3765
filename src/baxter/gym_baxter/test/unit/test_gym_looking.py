# SPDX-License-Identifier: BSD-3-Clause
"""The ball about a goal in pictures for people: where it is, how large, and behind what stands before it."""
import numpy as np
import pytest

from baxter_lab.cameras import CameraPicture
from gym_baxter.core import Core
from gym_baxter.looking import outside_picture, with_ball

# From 2 m in front of the origin, along -x.
CAMERA = np.array([[0.0, 0.0, -1.0, 2.0], [1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
FOCUS = 400.0
MATRIX = np.array([[FOCUS, 0.0, 100.0], [0.0, FOCUS, 75.0], [0.0, 0.0, 1.0]])


def drawn(place, depth, radius=0.1):
    """(150, 200) bool: where the ball is seen before, or behind, a wall at a depth [m]."""
    picture = CameraPicture(np.zeros((150, 200, 3), np.uint8), np.full((150, 200), depth), CAMERA, MATRIX)
    return with_ball(picture, np.array(place), radius).any(axis=2)


@pytest.mark.parametrize("depth", [5.0, np.inf, np.nan])
def test_a_ball_is_a_disc_of_its_size_where_it_is(depth):
    seen = drawn((0.0, 0.2, 0.1), depth)
    rows, columns = np.nonzero(seen)
    # y of `base` is to the right of this camera, z up.
    middle = 100.0 + FOCUS * 0.2 / 2.0, 75.0 - FOCUS * 0.1 / 2.0
    assert (columns.mean(), rows.mean()) == pytest.approx(middle, abs=1.0)
    assert seen.sum() == pytest.approx(np.pi * (FOCUS * 0.1 / 2.0) ** 2, rel=0.03)


def test_what_stands_before_a_ball_hides_it_and_what_passes_through_a_part():
    assert not drawn((0.0, 0.0, 0.0), 1.85).any()
    assert 0 < drawn((0.0, 0.0, 0.0), 1.95).sum() < 0.9 * drawn((0.0, 0.0, 0.0), 3.0).sum()
    assert not drawn((3.0, 0.0, 0.0), 9.0).any()  # behind the camera


@pytest.mark.parametrize("task, has_goal", [("Reach", True), ("PickPlace", True), ("Drawer", False)])
def test_the_goal_of_a_task_is_seen_by_people_and_not_by_the_robot(task, has_goal):
    core = Core(task)
    try:
        core.reset(np.random.default_rng(1))
        plain = core.lab.cameras.take("head", 64, 48).pixels.copy()
        # Edges are drawn in another way without depth.
        nowhere = np.array([0.0, 0.0, -50.0]) if has_goal else None
        shown, bare = core.look(240, 180), outside_picture(core.lab, 240, 180, nowhere, 0.03)
        differs = (shown != bare).any(axis=2)
        assert differs.any() == has_goal
        assert (shown[differs].argmax(axis=1) == 1).all()  # green
        assert np.array_equal(core.lab.cameras.take("head", 64, 48).pixels, plain)
    finally:
        core.close()
