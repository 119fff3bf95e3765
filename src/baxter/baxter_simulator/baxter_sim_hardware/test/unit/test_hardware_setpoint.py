# SPDX-License-Identifier: BSD-3-Clause
"""The set-point profile: bounded speed and acceleration, exact arrival."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baxter_sim_hardware.setpoint import MovingAverage, approach, stopping_point

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


def test_moving_average_of_a_staircase_is_a_ramp():
    average = MovingAverage(10, np.zeros(1))
    out = [average.push(np.array([0.01 * (tick // 5)]))[0] for tick in range(100)]  # a 100 Hz stream at 500 Hz
    np.testing.assert_allclose(np.diff(out)[15:], 0.002, atol=1e-12)


def test_moving_average_arrives_exactly():
    average = MovingAverage(10, np.zeros(1))
    for _ in range(10):
        out = average.push(np.array([0.7]))
    assert out[0] == pytest.approx(0.7, abs=1e-15)
