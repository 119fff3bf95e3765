# SPDX-License-Identifier: BSD-3-Clause
"""A motion from which an arm's actuators can be told: in front of the robot, slow enough for people beside it."""
from __future__ import annotations

import numpy as np

from baxter_model import JOINTS, poses

from .arm_body import Array

PERIOD_S = 0.01
REST_S = 4.0  # before and after, so that the integral is at rest
#: How long the motion may be [s].
SECONDS = (10.0, 180.0)
#: {joint: amplitude [rad]} around the pose "neutral"; each joint has three frequencies of its own [Hz]. What w2 turns
#: is so light that only a fast swing, in which its motor's inertia counts, tells gain, damping and friction apart.
AMPLITUDES = {"s0": 0.20, "s1": 0.16, "e0": 0.22, "e1": 0.20, "w0": 0.30, "w1": 0.25, "w2": 0.25}
FREQUENCIES = np.array([[0.17, 0.47, 0.83], [0.23, 0.53, 0.91], [0.19, 0.43, 0.97], [0.29, 0.59, 0.79],
                        [0.31, 0.89, 1.61], [0.37, 0.73, 1.37], [0.41, 1.03, 3.1]])
_SHARES = (0.55, 0.3, 0.15)
_HALT_S = 5.0  # the motion halts for a second so often: what overshoots shows
_EASE_S = 1.0


def motion(side: str, seconds: float) -> Array:
    """(rows, 7) [rad] raw set-points of one arm every PERIOD_S; begins and ends in the pose "neutral", at rest."""
    middle = np.array(list(poses().angles("neutral", side).values()))
    return middle + swing(seconds)


def swing(seconds: float) -> Array:
    """(rows, 7) [rad] the same around 0."""
    # A clock that stands still for a second before each halt ends: position is held, then goes on where it was.
    time_s = PERIOD_S * np.arange(round(seconds / PERIOD_S))
    whole, part = np.divmod(time_s, _HALT_S)
    clock = whole * (_HALT_S - 1.0) + np.minimum(part, _HALT_S - 1.0)
    ease = np.clip(np.minimum(time_s, seconds - time_s) / _EASE_S, 0.0, 1.0)
    ease = ease * ease * (3.0 - 2.0 * ease)
    waves = np.sin(2.0 * np.pi * FREQUENCIES[None] * clock[:, None, None]) @ np.array(_SHARES)
    moved = ease[:, None] * waves * np.array([AMPLITUDES[joint] for joint in JOINTS])
    still = np.zeros((round(REST_S / PERIOD_S), len(JOINTS)))
    return np.concatenate([still, moved, still])
