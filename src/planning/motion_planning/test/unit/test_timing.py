# SPDX-License-Identifier: BSD-3-Clause
"""Times of paths: limits hold between the points, ends are at rest, the curve stays where the path is."""
import numpy as np
import pytest

from motion_planning.timing import ALGORITHMS, Timed, TimingError, time_path, within_limits
from motion_planning.timing.kernels import peaks_of_cubics, second_derivatives
from motion_planning.timing.waypoints import _spline

VELOCITY = np.array([0.75, 0.75, 1.0, 1.0, 2.0])
ACCELERATION = np.array([2.0, 1.0, 2.0, 4.0, 2.0])
OPTIMAL = ("time_optimal_trajectory_generation", "ruckig")
THROUGH = ("iterative_time_parameterization", "iterative_spline_parameterization")


def paths():
    """Straight, with corners, dense around a curve, with a full reversal, tiny, and with long and short steps."""
    random = np.random.default_rng(7)
    s = np.linspace(0.0, 3.0, 60)[:, None]
    yield "straight", np.array([[0.0] * 5, [1.0, -0.5, 0.2, 0.0, 2.0]])
    yield "corners", random.uniform(-1.5, 1.5, (7, 5))
    yield "curve", np.sin(s * np.arange(1, 6))
    yield "reversal", np.array([[0.0] * 5, [1.0] * 5, [0.0] * 5])
    yield "tiny", np.array([[0.0] * 5, [1e-4, 0.0, 0.0, 0.0, -1e-5]])
    yield "uneven", np.cumsum(random.normal(size=(12, 5)) * 10.0 ** random.uniform(-3.0, 0.0, (12, 1)), axis=0)


PATHS = dict(paths())


def sampled(timed, per_second=500):
    times = np.linspace(0.0, timed.duration, max(2000, int(per_second * timed.duration)))
    return times, *timed.sampled(times)


def distance_to_lines(points, path):
    """The distance (n,) of points (n, k) to the lines through path (m, k)."""
    start, step = path[:-1], np.diff(path, axis=0)
    along = np.einsum("nmk,mk->nm", points[:, None] - start, step) / (step**2).sum(axis=1)
    nearest = start + np.clip(along, 0.0, 1.0)[:, :, None] * step
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_limits_hold_between_the_points(algorithm, name):
    timed = time_path(PATHS[name], VELOCITY, ACCELERATION, algorithm)
    _, q, v, a = sampled(timed)
    assert (np.abs(v).max(axis=0) <= VELOCITY * 1.0005).all(), np.abs(v).max(axis=0) / VELOCITY
    assert (np.abs(a).max(axis=0) <= ACCELERATION * 1.0005).all(), np.abs(a).max(axis=0) / ACCELERATION


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_velocities_are_those_of_the_positions(algorithm, name):
    """Numerical derivatives of the sampled positions, so that the limits above say something about the motion."""
    timed = time_path(PATHS[name], VELOCITY, ACCELERATION, algorithm)
    times, q, v, a = sampled(timed)
    step = times[1] - times[0]
    assert np.abs(np.diff(q, axis=0) / step - 0.5 * (v[1:] + v[:-1])).max() < 2e-3
    assert (np.diff(timed.times) > 0.0).all() and timed.times[0] == 0.0


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_ends_are_the_paths_at_rest(algorithm, name):
    timed = time_path(PATHS[name], VELOCITY, ACCELERATION, algorithm)
    assert np.allclose(timed.positions[[0, -1]], PATHS[name][[0, -1]], atol=1e-12)
    assert np.allclose(timed.velocities[[0, -1]], 0.0, atol=1e-9)
    if algorithm != "iterative_time_parameterization":
        assert np.allclose(timed.accelerations[[0, -1]], 0.0, atol=1e-6)


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("tolerance", [0.05, 0.002])
@pytest.mark.parametrize("algorithm", OPTIMAL)
def test_optimal_curves_stay_at_the_lines(algorithm, tolerance, name):
    timed = time_path(PATHS[name], VELOCITY, ACCELERATION, algorithm, tolerance=tolerance)
    mean = np.linalg.norm(ACCELERATION) * (0.1 if algorithm == OPTIMAL[0] else 0.2)**2 / 24.0
    assert distance_to_lines(sampled(timed)[1], PATHS[name]).max() < tolerance + 1.1 * mean


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("algorithm", THROUGH)
def test_iterative_ones_pass_through_every_point(algorithm, name):
    timed = time_path(PATHS[name], VELOCITY, ACCELERATION, algorithm)
    for point in PATHS[name]:
        assert np.abs(timed.positions - point).max(axis=1).min() < 1e-12
    extra = 2 if algorithm == "iterative_spline_parameterization" else 0
    assert len(timed.times) == len(PATHS[name]) + extra


def test_splines_have_one_velocity_on_both_sides_of_a_point_and_none_at_the_ends():
    rng = np.random.default_rng(5)
    h, path = rng.uniform(0.05, 1.0, (9, 1)), rng.normal(size=(10, 3))
    bend, slopes = second_derivatives(h[:, 0].copy(), path), np.diff(path, axis=0) / h
    leaving = slopes - h * (2.0 * bend[:-1] + bend[1:]) / 6.0
    arriving = slopes + h * (bend[:-1] + 2.0 * bend[1:]) / 6.0
    assert np.allclose(leaving[1:], arriving[:-1]) and np.allclose([leaving[0], arriving[-1]], 0.0, atol=1e-9)


def test_peaks_of_cubics_are_those_between_the_points():
    rng = np.random.default_rng(6)
    for _ in range(20):
        h, path = rng.uniform(0.05, 1.0, 9), rng.normal(size=(10, 3))
        timed = _spline(h, path, rest_acceleration=False)
        speeds, accelerations = peaks_of_cubics(h, timed.velocities, timed.accelerations)
        for k, begin in enumerate(timed.times[:-1]):
            _, velocities, bends = timed.sampled(np.linspace(begin, timed.times[k + 1], 2001)[1:-1])
            assert np.allclose(np.abs(velocities).max(axis=0), speeds[k], rtol=0.01, atol=1e-3)
            assert np.allclose(np.abs(bends).max(axis=0), accelerations[k], rtol=0.01, atol=1e-2)


@pytest.mark.parametrize("length", [0.01, 0.5, 3.0])
def test_time_optimal_is_near_the_best_there_is(length):
    """One joint on a line: a trapezoid of velocity is the optimum; the window adds its length."""
    timed = time_path([[0.0], [length]], [1.0], [2.0])
    best = 2.0 * np.sqrt(length / 2.0) if length < 0.5 else length / 1.0 + 1.0 / 2.0
    assert best <= timed.duration < 1.06 * best + 0.1


def test_corners_are_taken_without_stopping():
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    timed = time_path(path, [1.0, 1.0], [2.0, 2.0], tolerance=0.05)
    _, q, v, _ = sampled(timed)
    inside = (q[:, 0] > 0.5) & (q[:, 1] < 0.5)
    assert np.linalg.norm(v[inside], axis=1).min() > 0.2
    tight = time_path(path, [1.0, 1.0], [2.0, 2.0], tolerance=0.001)
    assert timed.duration < tight.duration


def test_ruckig_limits_jerk():
    path = np.array([[0.0], [2.0]])
    for algorithm, jerk in (("ruckig", 20.0), ("time_optimal", 40.0)):
        _, _, _, a = sampled(time_path(path, [1.0], [2.0], algorithm), 2000)
        assert 0.3 * jerk < np.abs(np.diff(a, axis=0)).max() * 2000 < 3.0 * jerk


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_scaled_limits_make_it_slower(algorithm):
    path = PATHS["corners"]
    whole = time_path(path, VELOCITY, ACCELERATION, algorithm)
    tenth = time_path(path, 0.1 * VELOCITY, 0.1 * ACCELERATION, algorithm)
    assert 2.5 < tenth.duration / whole.duration < 11.0


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_one_point_takes_no_time(algorithm):
    for path in ([[1.0, 2.0]], [[1.0, 2.0], [1.0, 2.0]]):
        timed = time_path(path, [1.0, 1.0], [1.0, 1.0], algorithm)
        assert timed.times.tolist() == [0.0] and timed.positions.tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize("path, velocity, acceleration, sentence", [
    ([], [1.0], [1.0], "at least one"),
    ([[0.0], [np.nan]], [1.0], [1.0], "point 1 of the path is not finite"),
    ([[0.0], [1.0]], [0.0], [1.0], "velocity limits must be finite and above 0"),
    ([[0.0], [1.0]], [1.0], [np.inf], "acceleration limits must be finite"),
    ([[0.0], [1.0]], [1.0, 1.0], [1.0], "1 joints but velocity limits of shape (2,)"),
    ([["a"]], [1.0], [1.0], "arrays of numbers"),
])
def test_what_cannot_be_timed_says_why(path, velocity, acceleration, sentence):
    with pytest.raises(TimingError) as refused:
        time_path(path, velocity, acceleration)
    assert sentence in str(refused.value)


def test_unknown_algorithm_is_named():
    with pytest.raises(ValueError, match="no time parameterization 'warp'"):
        time_path([[0.0], [1.0]], [1.0], [1.0], "warp")


def test_random_paths_keep_their_limits():
    random = np.random.default_rng(11)
    for _ in range(30):
        k = random.integers(1, 9)
        path = np.cumsum(random.normal(size=(random.integers(2, 15), k)) * random.choice([1e-3, 0.1, 1.0]), axis=0)
        velocity, acceleration = random.uniform(0.1, 3.0, k), random.uniform(0.1, 5.0, k)
        timed = time_path(path, velocity, acceleration, random.choice(ALGORITHMS))
        _, _, v, a = sampled(timed)
        assert (np.abs(v) <= velocity * 1.0005).all() and (np.abs(a) <= acceleration * 1.0005).all()


def test_stretching_keeps_what_is_within_its_limits():
    timed = time_path([[0.0], [1.0]], [1.0], [1.0])
    assert within_limits(timed, np.array([1.0]), np.array([1.0])).duration == pytest.approx(timed.duration)
    assert np.isclose(timed.stretched(2.0).duration, 2.0 * timed.duration)
    assert isinstance(timed, Timed)


@pytest.mark.parametrize("name", PATHS)
def test_times_that_are_spaced_leave_no_gap_and_no_point_out(name):
    timed = time_path(PATHS[name], VELOCITY, ACCELERATION)
    times = timed.spaced(0.01)
    assert np.isin(timed.times, times).all() and (np.diff(times) > 0.0).all()
    assert np.abs(np.diff(timed.sampled(times)[0], axis=0)).max(initial=0.0) <= 0.01 + 1e-9


@pytest.mark.parametrize("algorithm", THROUGH)
def test_dense_points_of_a_smooth_path_are_passed_as_fast_as_a_few(algorithm):
    """Cartesian paths have a point per centimetre."""
    along = np.linspace(0.0, 1.0, 80)
    path = np.column_stack([np.sin(1.5 * along), 2.0 * along - along**2, -0.7 * along**3])
    limits = np.full(3, 3.0), np.full(3, 1.0)
    best = time_path(path, *limits).duration
    assert time_path(path, *limits, algorithm).duration < 1.3 * best
