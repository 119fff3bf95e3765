# SPDX-License-Identifier: BSD-3-Clause
"""Least squares on a model whose numbers are known: found, uncertain where the data say nothing, left out by blocks."""
import numpy as np
import pytest

from baxter_sysid.fit import FitBounds, block_slices, instrumented, least_squares, left_out, rms

TIME_S = np.linspace(0.0, 4.0, 400)
TRUE = np.array([2.0, 0.7])
BOUNDS = FitBounds(np.array([0.0, 0.0]), np.array([10.0, 5.0]), np.array([0.02, 0.01]))


def model(numbers):
    return np.stack([numbers[0] * np.exp(-numbers[1] * TIME_S), np.sin(numbers[1] * TIME_S)], axis=1)


def noisy(seed, size=0.02):
    return model(TRUE) + size * np.random.default_rng(seed).standard_normal((len(TIME_S), 2))


def test_numbers_are_found_within_their_uncertainty():
    off = []
    for seed in range(20):
        data = noisy(seed)
        fit = least_squares(lambda numbers, data=data: model(numbers) - data, np.array([5.0, 0.2]), BOUNDS)
        off.append((fit.numbers - TRUE) / fit.deviation)
        np.testing.assert_allclose(fit.numbers, TRUE, rtol=0.02)
    assert 0.3 < np.std(off) < 2.5


def test_numbers_of_which_only_the_ratio_counts_are_uncertain():
    data = np.outer(TIME_S, [1.0, 1.0])
    data = data + 0.01 * np.random.default_rng(1).standard_normal(data.shape)

    def errors(numbers):
        return np.outer(TIME_S, [1.0, 1.0]) * numbers[0] / numbers[1] - data

    fit = least_squares(errors, np.array([3.0, 2.0]), BOUNDS)
    assert fit.numbers[0] / fit.numbers[1] == pytest.approx(1.0, rel=0.01)
    assert (fit.deviation > 0.3 * fit.numbers).all()


def test_a_model_with_noise_of_its_own_is_fitted_without_bias():
    swing, bounds = np.sin(3.0 * TIME_S), FitBounds(np.array([0.0]), np.array([10.0]), np.array([0.02]))

    def response(gain, draw):
        return gain * (swing + 0.5 * np.random.default_rng(draw).standard_normal(len(TIME_S)))[:, None]

    data = response(2.0, 9)
    fit = least_squares(lambda numbers: response(numbers[0], 0) - data, np.array([3.0]), bounds)
    assert fit.numbers[0] < 1.6
    better = instrumented(lambda numbers: np.mean([response(numbers[0], draw) for draw in (1, 2, 3, 4)], axis=0) - data,
                          lambda numbers: response(numbers[0], 5) - data, fit, bounds)
    assert better.numbers[0] == pytest.approx(2.0, abs=max(0.1, 3.0 * better.deviation[0]))
    assert better.deviation[0] < 0.15


def test_a_number_that_changes_nothing_is_kept_and_has_no_certainty():
    fit = least_squares(lambda numbers: (numbers[0] - np.ones((50, 1))), np.array([3.0, 1.5]), BOUNDS)
    assert fit.numbers == pytest.approx([1.0, 1.5]) and np.isinf(fit.deviation[1])


def test_numbers_that_make_up_for_each_other_move_together():
    """Any change of one of them alone is worse, and at the corner slopes say that both are."""
    def errors(numbers):
        return np.array([[100.0 * abs(numbers[0] - numbers[1])], [0.5 * numbers.sum() - 1.0]])

    found = least_squares(errors, np.array([0.5, 0.5]), FitBounds(np.zeros(2), np.full(2, 5.0), np.full(2, 0.01)))
    np.testing.assert_allclose(found.numbers, 1.0, atol=1e-3)


def test_a_number_leaves_a_hollow_of_a_few_steps():
    """As the torque that friction held at the start: the cost has a second least value beside the true one."""
    def errors(numbers):
        return np.interp(numbers[:1], (-0.2, -0.05, -0.02, 0.0, 0.2), (4.0, 1.5, 1.6, 0.0, 4.0))[:, None]

    found = least_squares(errors, np.array([-0.05]), FitBounds(np.array([-1.0]), np.array([1.0]), np.array([0.02])))
    assert abs(found.numbers[0]) < 0.005


def test_numbers_stay_within_their_bounds():
    tight = BOUNDS._replace(most=np.array([1.5, 5.0]))
    fit = least_squares(lambda numbers: model(numbers) - model(TRUE), np.array([1.0, 0.5]), tight)
    assert fit.numbers[0] == 1.5


def test_a_block_that_is_left_out_is_judged_by_the_others():
    data = noisy(3)
    strange = block_slices(len(TIME_S))[4]
    data[strange] += 0.5
    fit = least_squares(lambda numbers: model(numbers) - data, np.array([2.0, 0.7]), BOUNDS)
    without = left_out(lambda numbers: model(numbers) - data, fit, BOUNDS, rounds=2)
    assert without.shape == (10, *data.shape)
    assert rms(without[4][strange]).min() > 0.45
    # Without the strange block the others are as near as their noise.
    assert rms(without[4][:100]).max() < 0.03
