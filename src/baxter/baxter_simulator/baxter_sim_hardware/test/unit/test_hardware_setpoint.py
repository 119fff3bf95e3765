# SPDX-License-Identifier: BSD-3-Clause
"""The set-point profile: bounded speed and acceleration, exact arrival."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baxter_sim_hardware.arms.setpoint import MovingAverage, SetPoints, approach, follow, stopping_point

DT = 0.002


def run(start, target, speed, acceleration, velocity=0.0, limit=80000):
    position, rate = np.array([start]), np.array([velocity])
    target, speed, acceleration = np.array([target]), np.array([speed]), np.array([acceleration])
    path, rates = [start], [velocity]
    for _ in range(limit):
        position, rate = approach(position, rate, target, speed, acceleration, DT)
        path.append(position[0])
        rates.append(rate[0])
        if position[0] == target[0] and rate[0] == 0.0:
            break
    return np.array(path), np.array(rates)


@settings(max_examples=25, deadline=None)
@given(start=st.floats(-3.0, 3.0), target=st.floats(-3.0, 3.0), speed=st.floats(0.5, 4.0),
       acceleration=st.floats(2.0, 60.0))
def test_arrives_exactly_within_its_bounds_and_without_overshoot(start, target, speed, acceleration):
    path, rates = run(start, target, speed, acceleration)
    assert path[-1] == target and rates[-1] == 0.0
    assert np.abs(rates).max() <= speed + 1e-9
    assert np.abs(np.diff(rates)).max(initial=0.0) <= acceleration * DT + 1e-9
    assert path.min() >= min(start, target) - 1e-9 and path.max() <= max(start, target) + 1e-9
    ideal = abs(target - start) / speed + speed / acceleration
    assert len(path) * DT <= ideal + 0.01 + 5 * DT


def test_speed_zero_does_not_move():
    path, _ = run(0.3, 1.0, 0.0, 10.0, limit=100)
    assert np.all(path == 0.3)


def test_brakes_to_its_stopping_point_in_one_go():
    rest = stopping_point(np.array([0.0]), np.array([1.2]), np.array([10.0]))[0]
    path, rates = run(0.0, rest, 1.5, 10.0, velocity=1.2)
    assert rest == pytest.approx(1.2 ** 2 / 20.0)
    assert rates.min() >= -10.0 * DT - 1e-9  # at most one tick of correction, no swing back
    assert path.max() <= rest + 1.2 * DT


def fast_points(count):
    """Set-points at zero that may go anywhere in a tick."""
    points = SetPoints(count)
    points.speed[:] = points.acceleration[:] = points.stopping[:] = points.stream_acceleration[:] = 1e9
    return points


def smoothed(stairs, ticks=10):
    """The results of `follow` for set-points that jump from one of `stairs` (m, n) to the next, tick by tick."""
    points, at_zero = fast_points(stairs.shape[1]), np.zeros(stairs.shape[1])
    average = MovingAverage(ticks, at_zero)
    out = []
    for stair in stairs:
        points.target[:] = stair
        follow(points.numbers, points.flags, average.window, average.oldest, at_zero, 1.0, DT)
        average.turn()
        out.append(points.output.copy())
    return np.array(out)


def test_moving_average_of_a_staircase_is_a_ramp():
    stairs = np.array([[0.01 * (tick // 5), -0.02 * (tick // 5)] for tick in range(100)])  # a 100 Hz stream at 500 Hz
    steps = np.diff(smoothed(stairs), axis=0)[15:]
    np.testing.assert_allclose(steps, np.tile([0.002, -0.004], (len(steps), 1)), atol=1e-12)


def test_moving_average_arrives_exactly():
    assert smoothed(np.full((10, 1), 0.7))[-1, 0] == pytest.approx(0.7, abs=1e-15)


@pytest.mark.parametrize("kind", ["braking", "streams"])
def test_what_brakes_or_streams_is_not_smoothed(kind):
    points, now = fast_points(2), np.zeros(2)
    points.target[:] = points.goal[:] = 1e-3
    getattr(points, kind)[0] = True
    _, braked, _ = follow(points.numbers, points.flags, MovingAverage(10, now).window, 0, now, 1.0, DT)
    assert points.output == pytest.approx([1e-3, 1e-4], rel=1e-12)
    assert points.output_rate == pytest.approx(points.output / DT, rel=1e-12)
    assert braked == (kind == "braking")


def test_follow_tells_rest_and_a_lead():
    def tick(start, target, measured, reach):
        points = SetPoints(1)
        points.position[:] = points.output[:] = start
        points.target[:], points.speed[:], points.acceleration[:] = target, 1.0, 10.0
        return follow(points.numbers, points.flags, np.full((5, 1), start), 0, np.array([measured]), reach, DT)

    assert tick(0.5, 0.5, 0.5, 1e-3) == (True, False, False)
    assert tick(0.5, 0.6, 0.5, 1e-3) == (False, False, False)
    assert tick(0.5, 0.5, 0.498, 1e-3) == (True, False, True)
