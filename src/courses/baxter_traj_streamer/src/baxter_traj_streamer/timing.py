# SPDX-License-Identifier: BSD-3-Clause
"""Arrival times of paths. Free of ROS."""
from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def transition_time(difference: ArrayLike, velocity: ArrayLike, scale: float = 1.0) -> float:
    """Shortest time [s] in which all joints can move by ``difference`` (n,) [rad], without acceleration limits.

    ``velocity`` (n,) [rad/s]: limits, multiplied by ``scale``. Raises ValueError for sizes that differ or numbers that
    are not finite.
    """
    difference = np.asarray(difference, dtype=float)
    velocity = np.asarray(velocity, dtype=float)
    if difference.shape != velocity.shape:
        raise ValueError("got %d joint differences, expected %d" % (difference.size, velocity.size))
    if not np.isfinite(difference).all():
        raise ValueError("joint differences must be finite, got %s" % difference.tolist())
    return float(np.max(np.abs(difference) / (velocity * scale)))


def arrival_times(path: Iterable[ArrayLike], velocity: ArrayLike, min_segment_s: float) -> list[float]:
    """Arrival times at m poses ``path`` (m, n) [rad]: list of m times [s], the first 0. Raises ValueError."""
    times = [0.0]
    for here, there in itertools.pairwise(path):
        step = transition_time(np.subtract(there, here), velocity)
        times.append(times[-1] + max(step, min_segment_s))
    return times
