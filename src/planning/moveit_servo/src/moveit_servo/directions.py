# SPDX-License-Identifier: BSD-3-Clause
"""From a twist to joint velocities, at singularities too.

A singular direction is one in which the hand moves little for much motion of the joints. It slows the whole motion down
to a third, so that the hand keeps its direction; beyond that, what is lost is lost in this direction alone, and all
others go on. Motion towards the singularity brakes before it, as before a joint limit. Motion out of it never fades:
where the arm is stretched, its joints move although the hand does not yet, since bending the elbow either way brings
the hand back.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Step along a singular direction by which its change is looked up [rad].
_PROBE_RAD = 0.02
# Change of a singular value [per rad] below which the motion does not lead towards the singularity.
_LEVEL = 0.03
# Way between a singularity and a joint limit [rad] below which the arm is bent the other way, through the singularity.
_POCKET_RAD = 0.4
# Velocity without effect on the hand, away from joint limits [rad/s], and the share of the joint's travel, on each
# side, in which it acts. It grows with the speed of the joints, up to this one [rad/s].
_POSTURE_SPEED, _POSTURE_SHARE, _POSTURE_FULL_AT = 0.4, 0.3, 0.2
# Least weight of a joint motion in the metric of the nearest motion, in shares of the largest singular value.
_MIN_WEIGHT, _FREE_WEIGHT = 0.1, 0.05
# By which factor a singular direction may slow the whole motion down; and the time in which the way to the singularity
# would be covered at the speed there [s].
_MAX_SLOWING, _BRAKING_S = 3.0, 0.3


class Wanted(NamedTuple):
    """velocity (k,) of the joints; metric (k, k): how much a deviation from it counts; lost, share of the twist that a
    singularity takes, 0 to 1; condition: ratio of the largest singular value to the least."""

    velocity: np.ndarray
    metric: np.ndarray
    lost: float
    condition: float


class Thresholds(NamedTuple):
    """Condition numbers: from which a direction is singular, and at which motion towards the singularity ends."""

    lower: float
    hard: float


def velocity_for(twist, jacobian, jacobian_at, q, limits, thresholds) -> Wanted:
    """Return the Wanted joint velocities for ``twist`` (r,).

    jacobian (r, k): at ``q`` (k,), in the rows of the twist; jacobian_at(q) returns it elsewhere. limits: JointLimits.
    thresholds: Thresholds.
    """
    bounds = limits.lower, limits.upper
    left, values, right = np.linalg.svd(jacobian)
    rank = len(values)
    fading, gone = values[0] / max(thresholds.lower, 1.0), values[0] / max(thresholds.hard, thresholds.lower, 1.0)
    parts = left.T @ twist
    rates = np.empty(rank)
    for i, value in enumerate(values):
        if value >= fading or abs(parts[i]) < 1e-9:
            rates[i] = parts[i] / max(value, gone)
        else:
            most = _MAX_SLOWING * float((limits.velocity / np.maximum(np.abs(right[i]), 1e-6)).min())
            rate = _singular_rate(parts[i], value, (left[:, i], right[i]), jacobian_at, q, bounds, gone)
            rates[i] = min(max(rate, -most), most)
    velocity = right[:rank].T @ rates
    lost = parts - values * rates
    size = float(np.linalg.norm(twist))
    free = right[rank:]
    if len(free):
        effort = min(1.0, float(np.linalg.norm(velocity)) / _POSTURE_FULL_AT)
        velocity = velocity + effort * free.T @ (free @ _away_from_limits(q, *bounds))
    weights = np.maximum(values, _MIN_WEIGHT * values[0]) ** 2
    metric = (right[:rank].T * weights) @ right[:rank]
    if len(free):
        metric = metric + (_FREE_WEIGHT * values[0]) ** 2 * (free.T @ free)
    return Wanted(velocity, metric, float(np.linalg.norm(lost)) / size if size > 0.0 else 0.0,
                  float(values[0] / max(values[-1], 1e-12)))


def _singular_rate(part, value, direction, jacobian_at, q, bounds, gone) -> float:
    """The rate along a singular direction of the joints, of which the hand's motion is ``part`` / ``value``."""
    of_hand, of_joints = direction
    probe = _PROBE_RAD * of_joints
    change = float(of_hand @ (jacobian_at(q + probe) - jacobian_at(q - probe)) @ of_joints) / (2.0 * _PROBE_RAD)
    towards = np.sign(part)
    if towards * change < -_LEVEL:
        return towards * min(abs(part) / max(value, gone), max(value - gone, 0.0) / abs(change) / _BRAKING_S)
    rate = part / max(value, gone)
    if abs(change) > _LEVEL:
        pocket = value / abs(change) + _room(q, towards * of_joints, *bounds)
        if pocket < _POCKET_RAD < _room(q, -towards * of_joints, *bounds):
            return -rate
    return rate


def _room(q, direction, lower, upper) -> float:
    """How far ``q`` can move along ``direction`` before a joint is at its limit [rad]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(direction > 0.0, upper - q, q - lower) / np.abs(direction)
    return float(np.nanmin(np.where(np.abs(direction) > 1e-3, room, np.inf)))


def _away_from_limits(q, lower, upper):
    """Velocities (k,) away from limits that are near."""
    travel = upper - lower
    finite = np.isfinite(travel) & (travel > 0.0)
    zone = np.where(finite, _POSTURE_SHARE * np.where(finite, travel, 1.0), 1.0)
    below = np.where(finite, np.clip(1.0 - (q - np.where(finite, lower, 0.0)) / zone, 0.0, 1.0), 0.0)
    above = np.where(finite, np.clip(1.0 - (np.where(finite, upper, 0.0) - q) / zone, 0.0, 1.0), 0.0)
    return _POSTURE_SPEED * (below - above)
