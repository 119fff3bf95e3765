# SPDX-License-Identifier: BSD-3-Clause
"""Time-optimal trajectories: limits on a 1 kHz grid, and durations."""
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baxter_traj_streamer.optimal import time_optimal
from baxter_traj_streamer.timing import arrival_times

# The notes' velocities, the planner's accelerations [rad/s, rad/s^2], and the arm's range [rad].
VELOCITY = np.array([0.5, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0])
ACCELERATION = np.full(7, 2.0)
LOWER = np.array([-1.7, -2.147, -3.054, -0.05, -3.059, -1.57, -3.059])
UPPER = np.array([1.7, 1.047, 3.054, 2.618, 3.059, 2.094, 3.059])
DERATING = 0.5
# Relative: rounding.
SLACK = 1.0 + 1e-6


def random_path(seed, poses):
    return np.random.default_rng(seed).uniform(LOWER, UPPER, (poses, 7))


def on_grid(trajectory):
    """(times, 3, 7) each ms."""
    return np.array([trajectory.sample(t) for t in np.append(np.arange(0.0, trajectory.end_time, 1e-3),
                                                             trajectory.end_time)])


def check_limits(path, velocity, acceleration):
    trajectory = time_optimal(path, velocity, acceleration)
    grid = on_grid(trajectory)
    assert (np.abs(grid[:, 1]) <= velocity * SLACK).all()
    assert (np.abs(grid[:, 2]) <= acceleration * SLACK).all()
    # The same without trusting the derivatives: positions and velocities do not jump.
    assert (np.abs(np.diff(grid[:, 0], axis=0)) <= 1e-3 * velocity * SLACK + 1e-9).all()
    assert (np.abs(np.diff(grid[:, 1], axis=0)) <= 1e-3 * acceleration * SLACK + 1e-7).all()
    # Between the poses no joint leaves their span, so joint limits hold if the poses are within them.
    assert (grid[:, 0] >= np.min(path, axis=0) - 2e-6).all() and (grid[:, 0] <= np.max(path, axis=0) + 2e-6).all()
    assert grid[0, 0] == pytest.approx(path[0], abs=1e-9) and grid[-1, 0] == pytest.approx(path[-1], abs=1e-9)
    assert grid[0, 1] == pytest.approx(np.zeros(path.shape[1]), abs=1e-9)
    return trajectory


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), poses=st.integers(1, 8), step=st.sampled_from([1e-10, 1e-4, 0.03, 1.0]),
       joints=st.integers(1, 14))
def test_random_ways_keep_every_limit_on_a_1_khz_grid(seed, poses, step, joints):
    source = np.random.default_rng(seed)
    path = np.cumsum(source.uniform(-step, step, (poses, joints)), axis=0)
    # Joints that rest, and others that move in one direction only.
    path[:, source.random(joints) < 0.2] = 0.1
    path[:, source.random(joints) < 0.2] = np.linspace(0.0, step, poses)[:, None]
    check_limits(path, source.uniform(0.2, 2.0, joints), source.uniform(0.5, 5.0, joints))


def test_poses_are_passed_in_their_order():
    path = random_path(3, 6)
    grid = on_grid(check_limits(path, VELOCITY, ACCELERATION))[:, 0]
    passed = [int(np.argmin(np.abs(grid - pose).max(axis=1))) for pose in path]
    assert passed == sorted(passed)
    # A millisecond at full speed.
    assert all(np.abs(grid[k] - pose).max() < 1e-3 for k, pose in zip(passed, path, strict=True))


def test_twenty_random_ways_last_hardly_longer_than_they_must():
    """At most 15 % above the sum of the velocity-only times plus one ramp at either end; 25 % below the notes' rule."""
    for seed in range(20):
        path = random_path(seed, 3 + seed % 8)
        lasts = time_optimal(path, VELOCITY, ACCELERATION).end_time
        times = np.abs(np.diff(path, axis=0)) / VELOCITY
        ramps = sum(0.5 * VELOCITY[joint] / ACCELERATION[joint] for joint in times[[0, -1]].argmax(axis=1))
        bound = times.max(axis=1).sum()
        assert bound <= lasts <= 1.15 * (bound + ramps), "path %d" % seed
        assert lasts <= 0.75 * arrival_times(path, VELOCITY * DERATING, 0.02)[-1], "path %d" % seed


def test_rest_to_rest_is_a_straight_line_at_the_slowest_joints_pace():
    trajectory = time_optimal([[0.0, 0.0], [1.0, 0.2]], [0.5, 1.0], [2.0, 2.0])
    assert trajectory.end_time == pytest.approx(1.0 / 0.5 + 0.5 / 2.0)
    grid = on_grid(trajectory)
    assert grid[:, 0, 1] == pytest.approx(0.2 * grid[:, 0, 0])


def test_a_way_that_goes_straight_on_is_not_stopped_on_the_way():
    through = time_optimal([[0.0], [0.5], [1.0]], [0.5], [2.0])
    assert through.end_time == pytest.approx(1.0 / 0.5 + 0.5 / 2.0)


def test_nowhere_to_go_takes_no_time():
    trajectory = time_optimal([[0.3, 0.2]] * 3, [1.0, 1.0], [1.0, 1.0])
    assert trajectory.end_time == 0.0
    assert trajectory.sample(0.0)[0] == pytest.approx([0.3, 0.2])


def test_thousands_of_poses_are_timed_as_well():
    path = np.random.default_rng(1).uniform(-0.1, 0.1, (3000, 2))
    trajectory = time_optimal(path, [1.0, 1.0], [4.0, 4.0])
    assert trajectory.sample(trajectory.end_time)[0] == pytest.approx(path[-1], abs=1e-9)
