# SPDX-License-Identifier: BSD-3-Clause
"""Fit the actuators' free numbers to one arm of a recording, and test them on the other.

`./baxter.sh bench fidelity --fit left|right|both` prints what it finds beside physical_robot.yaml. The recording is
replayed by the plugin and the physics in this process. `least_squares` knows neither.
"""
from typing import NamedTuple

import numpy as np

from baxter_model import JOINTS, SIDES

ARMS = {"left": (0,), "right": (1,), "both": (0, 1)}
#: What is fitted, and the least value of each.
FREE = {"proportional_gain": 5.0, "motor_damping": 0.1, "friction": 0.0, "set_point_filter": 0.0}
ROUNDS = 3
# A number is changed by this share of itself, or by this much, to see what follows.
_SHARE, _LEAST = 0.03, 2e-3


class Fit(NamedTuple):
    """numbers (k, n) as fitted; error (samples, arms, n), simulated less recorded, with them."""

    numbers: np.ndarray
    error: np.ndarray

    @property
    def rms(self):
        """(arms, n) root mean square of the error."""
        return np.sqrt(np.mean(self.error ** 2, axis=0))


def least_squares(replay, start, least, arms, rounds=ROUNDS):
    """The numbers (k, n) that make the error of `arms` least, joint by joint; a `Fit`.

    replay: function (k, n) -> error (samples, arms, n), where a joint's error depends on its own numbers above all;
    start (k, n); least (k,): bounds from below; arms: which of the replay's count. Levenberg-Marquardt with a step and
    a damping for each joint: a step that makes a joint worse is not taken.
    """
    least = np.asarray(least, dtype=float)
    found, damping = np.maximum(start, least[:, None]), np.full(np.shape(start)[1], 1e-2)
    error = replay(found)
    for _ in range(rounds):
        slopes = np.array([_slope(replay, found, error, row) for row in range(len(found))])
        tried = found.copy()
        for joint in range(found.shape[1]):
            slope = slopes[:, :, list(arms), joint].reshape(len(found), -1)
            normal = slope @ slope.T
            normal += damping[joint] * np.diag(np.diagonal(normal) + 1e-12)
            step = np.linalg.solve(normal, slope @ error[:, list(arms), joint].reshape(-1))
            tried[:, joint] = np.maximum(found[:, joint] - step, least)
        new = replay(tried)
        better = _cost(new, arms) < _cost(error, arms)
        found, damping = np.where(better, tried, found), np.where(better, damping / 4.0, damping * 8.0)
        error = new if better.all() else replay(found)
    return Fit(found, error)


def _slope(replay, numbers, error, row):
    changed, by = numbers.copy(), np.maximum(_SHARE * np.abs(numbers[row]), _LEAST)
    changed[row] += by
    return (replay(changed) - error) / by


def _cost(error, arms):
    return np.sum(error[:, list(arms)] ** 2, axis=(0, 1))


class Replay:
    """A recording through the plugin and the physics, with actuators of any numbers.

    rows: {number: {joint: value}} of the actuators, of which those in FREE are replaced; recording: of
    `recording.Recording`.
    """

    def __init__(self, recording, rows):
        from replaying import bare_robot  # it loads the physics; a test of `least_squares` does without
        self._robot, self._recording, self._rows = bare_robot(), recording, rows

    def with_numbers(self, numbers):
        """Rows of actuators with `numbers` (k, 7) in place of FREE."""
        return {**self._rows, **{number: dict(zip(JOINTS, values.tolist(), strict=True))
                                 for number, values in zip(FREE, numbers, strict=True)}}

    def __call__(self, numbers):
        """(samples, 2, 7) simulated less recorded position [rad]."""
        from recording import JOINT_NAMES
        from replaying import replay

        from baxter_sim_hardware.arms.actuators import Actuators

        def change(baxter):
            baxter.actuators = Actuators(self.with_numbers(numbers), JOINT_NAMES)

        motion = replay(self._recording, "lag", self._robot, change=change).motion
        return (motion.position - self._recording.sensed).reshape(-1, len(SIDES), len(JOINTS))


def lines(start, fit, arm):
    """The table (list of text lines): numbers as they are (k, 7) and as fitted, RMSE of both arms."""
    title = "%-6s" + " %19s" * len(FREE) + " %9s %9s"
    rows = ["fitted to: %s; pairs: physical_robot.yaml, fitted" % arm,
            title % ("joint", *FREE, *("%s RMSE" % side for side in SIDES))]
    for j, joint in enumerate(JOINTS):
        rows.append(("%-6s" + " %9.4g %9.4g" * len(FREE) + " %9.4f %9.4f") % (
            joint, *np.stack([start[:, j], fit.numbers[:, j]], axis=1).reshape(-1), *fit.rms[:, j]))
    return rows


def main(path, arm, rounds=ROUNDS, seconds=None):
    """Print the fit to `arm` of a recording. Raises HardwareError, SystemExit for a file that is no recording."""
    from recording import Recording

    from baxter_sim_hardware import effects
    rows = effects.read(effects.physical_robot())["lag"]
    start = np.array([[rows[number][joint] for joint in JOINTS] for number in FREE])
    replay = Replay(Recording.read(path, seconds), rows)
    fit = least_squares(replay, start, list(FREE.values()), ARMS[arm], rounds)
    print("\n".join(lines(start, fit, arm)), flush=True)
    return fit
