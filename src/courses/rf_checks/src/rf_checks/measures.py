# SPDX-License-Identifier: BSD-3-Clause
"""Measures of the quality of a motion. Free of ROS; SI units, radians."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from urdf_model.transforms import rotation_angle

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Below this speed of its fastest joint an arm counts as resting [rad/s].
STANDS_RAD_S = 0.02
# Above this speed it moves again: at a turning point the speed oscillates about the bound above [rad/s].
MOVES_RAD_S = 0.06
# No joint of the robot turns faster than 4 rad/s: a larger step between two records [rad] is not a motion.
JUMP_RAD = 0.15
#: An arm has moved whose joint has gone farther than this [rad].
MOVED_RAD = 0.1
# Up to this distance from its goal a joint gets all points, from the second on none [rad].
AT_GOAL_RAD, OFF_GOAL_RAD = 0.02, 0.25


def ramp(value: float, full: float, none: float) -> float:
    """1 up to `full`, 0 from `none` on, linear between; either may be the larger one."""
    return float(np.clip((none - value) / (none - full), 0.0, 1.0))


def distance_from_goal(names: tuple[str, ...], angles: ArrayLike, goal: ArrayLike) -> tuple[float, float, str]:
    """(share of the points, largest distance [rad], that in words). names, angles [rad] and goal [rad]: (n,).

    No joint is named where all are at their goals: the farthest one would be another in each run.
    """
    off = np.abs(np.asarray(angles) - np.asarray(goal))
    share = float(np.mean([ramp(value, AT_GOAL_RAD, OFF_GOAL_RAD) for value in off]))
    if off.max() <= AT_GOAL_RAD:
        return share, off.max(), "all joints are within %g rad of their goals" % AT_GOAL_RAD
    return share, off.max(), "farthest off is %s, by %.3f rad" % (names[int(off.argmax())], off.max())


def pose_error(pose: np.ndarray, target: np.ndarray) -> tuple[float, float]:
    """(distance [m], angle [rad]) between two (4, 4) poses."""
    return float(np.linalg.norm(pose[:3, 3] - target[:3, 3])), rotation_angle(pose[:3, :3].T @ target[:3, :3])


def speeds(times: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """(n - 1,) speed of the fastest joint between two records [rad/s]. times (n,), positions (n, joints)."""
    return np.abs(np.diff(positions, axis=0)).max(axis=1) / np.maximum(np.diff(times), 1e-6)


def moving_rows(times: np.ndarray, positions: np.ndarray) -> tuple[int, int] | None:
    """(first, last) row of a motion, or None if nothing moved."""
    if len(times) < 2:
        return None
    moving = np.flatnonzero(speeds(times, positions) > STANDS_RAD_S)
    return (int(moving[0]), int(moving[-1]) + 1) if len(moving) else None


def halts(times: np.ndarray, positions: np.ndarray, window_s: float = 0.05) -> int:
    """Number of stops of an arm between the beginning and the end of its motion."""
    rows = moving_rows(times, positions)
    if rows is None:
        return 0
    speed = speeds(times, positions)[rows[0]:rows[1]]
    width = max(1, round(window_s / max(float(np.median(np.diff(times))), 1e-6)))
    smooth = np.convolve(speed, np.ones(width) / width, mode="valid") if len(speed) >= width else speed
    # Between both bounds the previous state continues.
    clear = smooth[(smooth < STANDS_RAD_S) | (smooth > MOVES_RAD_S)]
    stands = clear < STANDS_RAD_S
    return int(np.count_nonzero(stands[1:] & ~stands[:-1]))


def largest_jump(positions: np.ndarray) -> float:
    """The largest change of one joint between two records [rad]."""
    return float(np.abs(np.diff(positions, axis=0)).max()) if len(positions) > 1 else 0.0


def path_length(positions: np.ndarray) -> float:
    """Path length of the joint that moved most [rad]."""
    return float(np.abs(np.diff(positions, axis=0)).sum(axis=0).max()) if len(positions) > 1 else 0.0


def has_moved(positions: np.ndarray) -> bool:
    """Whether an arm has moved; positions (n, joints) [rad]."""
    return path_length(positions) > MOVED_RAD


class SineFit(NamedTuple):
    """amplitude [m], frequency [Hz], periods, r_squared (1: a perfect sine), start, end [s]."""

    amplitude: float
    frequency: float
    periods: float
    r_squared: float
    start: float
    end: float


NO_SINE = SineFit(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def fit_sine(times: np.ndarray, points: np.ndarray, min_periods: float = 1.5) -> SineFit:
    """The best sine in a path: times (n,), points (n, 3) [m]. The motions to its start and from its end are left out.

    Fits offset + sine along the main direction of motion, in windows that leave out some of either end.
    """
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.maximum(np.diff(times), 1e-6)
    moving = np.flatnonzero(speed > 0.005)
    if len(moving) < 50:
        return NO_SINE
    first, last = int(moving[0]), int(moving[-1]) + 1
    best = NO_SINE
    for head in np.arange(0.0, 0.75, 0.05):
        for tail in (0.0, 0.05, 0.1, 0.2, 0.3):
            if head + tail > 0.8:
                continue
            a, b = first + round(head * (last - first)), last - round(tail * (last - first))
            found = _fit_window(times[a:b:2], points[a:b:2])
            # A longer window may fit slightly worse.
            if found.periods >= min_periods and _worth(found) > _worth(best):
                best = found
    return best


def _worth(fit: SineFit) -> float:
    return fit.r_squared + 0.02 * min(fit.periods, 3.0)


def _fit_window(times: np.ndarray, points: np.ndarray) -> SineFit:
    if len(times) < 25:
        return NO_SINE
    centred = points - points.mean(axis=0)
    values = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
    power = float(values @ values)
    span = float(times[-1] - times[0])
    if power / len(values) < 1e-6 or span <= 0.0:
        return NO_SINE

    def residual(frequency: float) -> tuple[float, float]:
        phase = 2.0 * math.pi * frequency * (times - times[0])
        columns = np.stack((np.sin(phase), np.cos(phase), np.ones_like(phase)), axis=1)
        weights = np.linalg.lstsq(columns, values, rcond=None)[0]
        rest = values - columns @ weights
        return float(rest @ rest), float(np.hypot(weights[0], weights[1]))

    spectrum = np.abs(np.fft.rfft(values * np.hanning(len(values)), 4 * len(values)))
    peak = max(1, int(np.argmax(spectrum[1:])) + 1) / (4.0 * span)
    grid = peak * np.linspace(0.85, 1.15, 31)
    frequency = min(grid, key=lambda f: residual(f)[0])
    rest, amplitude = residual(frequency)
    return SineFit(amplitude, frequency, frequency * span, 1.0 - rest / power, float(times[0]), float(times[-1]))
