# SPDX-License-Identifier: BSD-3-Clause
"""The fit of the actuators: least squares on a model whose numbers are known; a short replay of the real one."""
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

BENCH = Path(__file__).resolve().parents[1] / "bench"
TRUE = np.array([[0.2, 0.1], [7.0, 30.0]])  # (delay, natural frequency) of two joints


@pytest.fixture(scope="module")
def modules():
    sys.path.insert(0, str(BENCH))
    yield {name: importlib.import_module(name) for name in ("fidelity_fit", "recording", "fidelity_bench", "replaying")}
    sys.path.remove(str(BENCH))


def answers(numbers, arms):
    """(samples, arms, joints): a step's answer of each joint; arms have sizes of their own."""
    time_s = np.linspace(0.0, 2.0, 200)[:, None]
    delay, omega = numbers
    late = np.maximum(time_s - delay, 0.0)
    step = 1.0 - np.exp(-0.6 * omega * late) * np.cos(0.8 * omega * late)
    return np.stack([size * step for size in arms], axis=1)


def replay(numbers):
    return answers(numbers, (1.0, 0.5)) - answers(TRUE, (1.0, 0.5))


@pytest.mark.parametrize("arms", [(0,), (1,), (0, 1)])
def test_finds_the_numbers_of_a_model_from_one_arm(modules, arms):
    fit = modules["fidelity_fit"].least_squares(replay, 1.15 * TRUE, (0.0, 0.0), arms, rounds=12)
    np.testing.assert_allclose(fit.numbers, TRUE, rtol=0.01)
    assert fit.rms.shape == (2, 2) and fit.rms.max() < 0.005


def test_only_the_arms_that_are_asked_for_count(modules):
    def crooked(numbers):
        error = replay(numbers)
        error[:, 1] += 5.0 * (numbers[0] - 0.4)
        return error

    fit = modules["fidelity_fit"].least_squares(crooked, 1.15 * TRUE, (0.0, 0.0), (0,), rounds=12)
    np.testing.assert_allclose(fit.numbers, TRUE, rtol=0.01)
    assert fit.rms[0].max() < 0.005 < fit.rms[1].min()


def test_numbers_stay_above_their_bounds_and_worse_steps_are_not_taken(modules):
    fit = modules["fidelity_fit"].least_squares(replay, 1.15 * TRUE, (0.21, 0.0), (0,), rounds=6)
    assert (fit.numbers[0] >= 0.21).all()
    first = np.sqrt(np.mean(replay(np.maximum(1.15 * TRUE, [[0.21], [0.0]])) ** 2, axis=0))
    assert (fit.rms[0] <= first[0]).all()


def test_the_table_has_each_joint_once_with_both_numbers(modules):
    fit_module = modules["fidelity_fit"]
    start = np.full((len(fit_module.FREE), 7), 1.0)
    text = fit_module.lines(start, fit_module.Fit(2.0 * start, np.full((3, 2, 7), 0.004)), "left")
    assert len(text) == 9 and "fitted to: left" in text[0]
    assert [line.split()[0] for line in text[2:]] == ["s0", "s1", "e0", "e1", "w0", "w1", "w2"]
    assert text[2].split()[1:3] == ["1", "2"] and text[2].split()[-1] == "0.0040"


def test_numbers_of_the_replay_matter(modules):
    """A second of the recording: with half the gain a shoulder is elsewhere."""
    from baxter_sim_hardware import effects
    fit_module = modules["fidelity_fit"]
    rows = effects.read(effects.physical_robot())["lag"]
    numbers = np.array([list(rows[number].values()) for number in fit_module.FREE])
    recording = modules["recording"].Recording.read(modules["fidelity_bench"].RECORDING, 1.5)
    made = fit_module.Replay(recording, rows)
    error = made(numbers)
    assert error.shape == (len(recording.time_s), 2, 7) and np.abs(error).max() < 0.05
    changed = numbers.copy()
    changed[0] *= 0.3
    assert np.abs(made(changed) - error).max() > 5e-4
    np.testing.assert_array_equal(made(numbers), error)


def test_a_recording_that_begins_in_motion_is_followed_from_where_it_says(modules):
    replaying, read = modules["replaying"], modules["recording"].Recording.read
    path, robot = modules["fidelity_bench"].RECORDING, modules["replaying"].bare_robot()
    resting = replaying.Start.of(read(path, 1.0))
    assert not resting.moves and resting.judged_from_s == 0.0 and "at rest" in resting.sentence()
    recording = read(path, 1.2, 15.0)
    assert recording.time_s[0] == pytest.approx(15.0)
    start = replaying.Start.of(recording)
    assert start.moves and "left_w1 at 1.19 rad/s" in start.sentence()
    done = replaying.replay(recording, "lag", robot)
    judged = recording.time_s >= recording.time_s[0] + start.judged_from_s
    assert np.abs(done.motion.position - recording.sensed)[judged].max() < 0.03
    assert not done.motion.bounded.any() and not any(done.events.values())


def test_a_second_beyond_the_recording_is_refused(modules):
    with pytest.raises(SystemExit, match="0 rows from its second 99"):
        modules["recording"].Recording.read(modules["fidelity_bench"].RECORDING, None, 99.0)
