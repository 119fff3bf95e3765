# SPDX-License-Identifier: BSD-3-Clause
"""The sheet: errors before and after a fit, the numbers with uncertainty, and each joint's worst second in words."""
from __future__ import annotations

import numpy as np

from baxter_model import JOINTS
from baxter_sim_hardware.arms.actuators import NUMBERS

from .arm_body import Array
from .fit import rms
from .identify import HELD, IdentifiedNumbers
from .recording import COUNT_RAD
from .replay import ReplayedMotion

_QUIET = 0.01  # [rad] errors below it have no cause worth naming
_FAST = 0.05  # [rad/s]


def errors(found: IdentifiedNumbers) -> list[str]:
    """Lines: RMSE [rad] of each joint before, after and left out, and the largest error."""
    lines = ["%-9s %9s %9s %9s %9s" % ("joint", "before", "after", "left out", "largest")]
    for arm, side in enumerate(found.sides):
        values = [rms(error[:, arm]) for error in (found.before, found.after, found.without)]
        largest = np.abs(found.after[:, arm]).max(axis=0)
        lines += ["%-9s %9.4f %9.4f %9.4f %9.4f" % ("%s_%s" % (side, joint), *(one[j] for one in values), largest[j])
                  for j, joint in enumerate(JOINTS)]
    return lines


def numbers(found: IdentifiedNumbers) -> list[str]:
    """Lines: the fitted numbers with their standard deviations, and what the recording does not determine."""
    lines = ["%s of %s: %.4g, +- %.2g" % (number, joint, value, deviation)
             for (number, joint), value, deviation in zip(found.names, found.values, found.deviations, strict=True)
             if number != HELD]
    for number, joint in found.refused:
        damping = ("motor_damping", joint)
        if number == "proportional_gain" and damping in found.names:
            gain = found.numbers[found.sides[0]][NUMBERS.index(number), JOINTS.index(joint)]
            lines.append("lag of %s, motor_damping by proportional_gain: %.4g s, +- %.2g; the two are not known" % (
                joint, found.value(damping) / gain, found.deviations[found.names.index(damping)] / gain))
    return lines + ["%s of %s: not determined (+- %.2g), kept" % (number, joint, deviation)
                    for (number, joint), deviation in found.refused.items() if number != HELD]


def worst_seconds(time_s: Array, error: Array, motion: ReplayedMotion, names: list[str],
                  events: dict[str, list[tuple[float, str]]] | None = None) -> list[str]:
    """Lines: for each joint the second in which `error` (rows, n) [rad] is largest, and what the model does there.

    motion: of the same rows; events: {joint: (time [s], what)} that a simulator has told, such as contacts.
    """
    period = float(np.median(np.diff(time_s)))
    rows = max(1, min(round(1.0 / period), len(error)))
    lines = []
    for j, name in enumerate(names):
        power = np.convolve(error[:, j] ** 2, np.ones(rows), "valid")
        first = int(np.argmax(power))
        there = slice(first, first + rows)
        at = first + int(np.argmax(np.abs(error[there, j])))
        told = sorted({what for moment, what in (events or {}).get(name, ())
                       if time_s[first] <= moment <= time_s[there.stop - 1]})
        lines.append("%s: worst from %.1f s, RMSE %.4f rad, %.4f rad off at %.2f s: %s" % (
            name, time_s[first], np.sqrt(power[first] / rows), error[at, j], time_s[at],
            ", ".join(told) or _cause(error[there, j], motion.bounded[there, j],
                                      np.gradient(motion.position[:, j], period)[there], at - first)))
    return lines


def _cause(error: Array, bounded: Array, speed: Array, at: int) -> str:
    if bounded[max(at - 20, 0):at + 1].any():
        return "the motor is at its torque limit"
    if np.abs(error).max() <= 3.0 * COUNT_RAD:
        return "within three counts of the sensor"
    if np.abs(error).max() < _QUIET:
        return "free motion, no bound, no contact"
    if abs(speed[at]) < _FAST:
        return "near rest or turning round: friction and the spring's swing"
    ahead = np.sign(speed[at]) * error[at] > 0.0
    return "free motion at %.1f rad/s, the model is %s" % (speed[at], "ahead" if ahead else "behind")
