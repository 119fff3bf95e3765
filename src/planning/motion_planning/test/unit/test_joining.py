# SPDX-License-Identifier: BSD-3-Clause
"""A trajectory that takes over from another one while the joints move."""
import numpy as np
import pytest

from motion_planning.timing import time_path
from motion_planning.timing.joining import LEAD_S, brakings, joined, joinings

VELOCITY, ACCELERATION = np.array([1.5, 1.0]), np.array([3.0, 4.0])
MOMENTS = np.linspace(0.02, 0.9, 12)


@pytest.fixture(scope="module")
def running():
    return time_path([[0.0, 0.0], [1.0, 0.3], [1.5, 1.5]], VELOCITY, ACCELERATION, "ruckig")


def state(timed, moment):
    return np.array(timed.sampled([moment]))[:, 0]


@pytest.mark.parametrize("share", MOMENTS)
def test_braking_continues_the_motion_and_ends_at_rest_within_the_limits(running, share):
    begin = share * running.duration
    for found in brakings(running, begin, ACCELERATION):
        np.testing.assert_allclose(state(found, 0.0), state(running, begin), atol=1e-9)
        assert np.abs(found.velocities[-1]).max() < 1e-9 and np.abs(found.accelerations[-1]).max() < 1e-6
        assert (found.peaks()[1] <= 1.01 * ACCELERATION).all()
        # What is said of velocities and positions fits together.
        off = found.sampled(found.times + 1e-4)[0] - found.sampled(found.times)[0] - 1e-4 * found.velocities
        assert np.abs(off).max() < 1e-6


def test_braking_on_the_path_stays_there(running):
    way = running.sampled(np.linspace(0.0, running.duration, 5000))[0]
    # The limits allow it everywhere.
    for share in MOMENTS:
        both = brakings(running, share * running.duration, 100.0 * ACCELERATION)
        far = [max(np.linalg.norm(way - q, axis=1).min() for q in found.positions) for found in both]
        assert len(both) == 2 and min(far) < 1e-3


def test_braking_takes_no_longer_than_it_must(running):
    begin = 0.4 * running.duration
    speed = np.abs(state(running, begin)[1])
    first = brakings(running, begin, ACCELERATION)[0]
    # A cubic fall of speed has its peak at 1.5 times the mean.
    assert first.duration < 1.25 * (1.5 * speed / ACCELERATION).max() + 0.2


def test_what_cannot_brake_on_its_path_brakes_straight_on(running):
    # Close to its end the trajectory brakes as hard as it may itself.
    assert any(len(brakings(running, share * running.duration, ACCELERATION)) == 1 for share in MOMENTS)


@pytest.mark.parametrize("share", MOMENTS)
def test_the_sum_begins_as_the_first_and_ends_as_the_second(running, share):
    begin = share * running.duration
    first = brakings(running, begin, ACCELERATION)[0]
    second = time_path([first.positions[-1], [1.0, -0.5], [0.0, -1.0]], VELOCITY, ACCELERATION, "ruckig")
    for overlap in (0.0, 0.5 * min(first.duration, second.duration), min(first.duration, second.duration)):
        found = joined(first, second, overlap)
        np.testing.assert_allclose(state(found, 0.0), state(running, begin), atol=1e-9)
        np.testing.assert_allclose(found.positions[-1], [0.0, -1.0], atol=1e-9)
        assert np.abs(found.velocities[-1]).max() < 1e-9
        assert found.duration == pytest.approx(first.duration + second.duration - overlap, abs=1e-5)
        assert (np.diff(found.times) > 5e-4).all() and found.times[1] >= min(LEAD_S, found.duration) - 1e-6
    # Without an overlap the second one begins at rest where the first one ends.
    np.testing.assert_allclose(state(joined(first, second, 0.0), first.duration)[0], first.positions[-1], atol=2e-3)


def test_a_turn_aside_needs_no_stop_and_keeps_to_the_limits(running):
    begin = 0.4 * running.duration
    first = brakings(running, begin, ACCELERATION)[0]
    second = time_path([first.positions[-1], first.positions[-1] + [0.6, -0.2]], VELOCITY, ACCELERATION, "ruckig")
    overlap, found = next(joinings(first, second, VELOCITY, ACCELERATION))
    assert overlap > 0.1
    speeds, accelerations = found.peaks()
    assert (speeds <= VELOCITY).all() and (accelerations <= ACCELERATION).all()
    moving = found.sampled(np.linspace(0.0, found.duration - 0.3, 200))[1]
    assert np.abs(moving).max(axis=1).min() > 0.1
    *_, (last, _) = joinings(first, second, VELOCITY, ACCELERATION)
    assert last == 0.0
