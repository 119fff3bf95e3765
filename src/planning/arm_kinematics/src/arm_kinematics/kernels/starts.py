# SPDX-License-Identifier: BSD-3-Clause
"""Starts of a search: the seed, then random postures that depend only on the request."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.kernels.compiled import compiled

if TYPE_CHECKING:
    from arm_kinematics.kernels import Arm, Limits, TargetArrays


@compiled
def _mix(state: np.uint64) -> tuple[np.uint64, np.uint64]:
    """One step of splitmix64 (Steele, Lea, Flood, OOPSLA 2014): returns (new state, 64 mixed bits)."""
    state += np.uint64(0x9E3779B97F4A7C15)
    z = state
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state, z ^ (z >> np.uint64(31))


@compiled
def _stir(state: np.uint64, values: np.ndarray) -> np.uint64:
    for bits in values.view(np.uint64):
        state, mixed = _mix(state ^ bits)
        state ^= mixed
    return state


@compiled
def state_of(target: TargetArrays, seed: np.ndarray) -> np.uint64:
    """Return the generator's first state: it depends only on the request."""
    rotation, position, _, _ = target
    return _stir(_stir(_stir(np.uint64(seed.shape[0]), position), rotation.ravel()), seed)


@compiled
def clamped(seed: np.ndarray, limits: Limits) -> np.ndarray:
    """Return the posture ``seed`` (n,) moved inside the limits."""
    lower, upper = limits
    inside = np.empty(seed.shape[0])
    for i in range(seed.shape[0]):
        inside[i] = min(max(seed[i], lower[i]), upper[i])
    return inside


@compiled
def fill_start(attempt: int, state: np.uint64, limits: Limits, seed: np.ndarray, start: np.ndarray) -> None:
    """Fill ``start`` (n,) with the posture that attempt number ``attempt`` begins at: the seed first, then random ones.

    Depends on nothing but the arguments: ``state`` is that of :func:`state_of`, so the same request gives the same
    starts, and a search can continue at any attempt.
    """
    n, (lower, upper) = seed.shape[0], limits
    if attempt == 0:
        start[:] = seed
        return
    # splitmix64 adds a constant at each step, so its state after any number of steps is known.
    state += np.uint64((attempt - 1) * n) * np.uint64(0x9E3779B97F4A7C15)
    for i in range(n):
        state, bits = _mix(state)
        fraction = float(bits >> np.uint64(11)) * 2.0 ** -53
        low = lower[i] if lower[i] > -math.inf else seed[i] - math.pi
        high = upper[i] if upper[i] < math.inf else seed[i] + math.pi
        start[i] = min(max(low + fraction * (high - low), lower[i]), upper[i])


@compiled
def turn_towards(arm: Arm, limits: Limits, preferred: np.ndarray, q: np.ndarray) -> None:
    """For a joint without limits, choose the equivalent angle nearest the posture ``preferred``."""
    _, _, prismatic = arm
    lower, upper = limits
    for i in range(q.shape[0]):
        if not prismatic[i] and lower[i] == -math.inf and upper[i] == math.inf:
            q[i] -= 2.0 * math.pi * round((q[i] - preferred[i]) / (2.0 * math.pi))
