# SPDX-License-Identifier: BSD-3-Clause
"""From a twist to joint velocities, at singularities too.

A singular direction is one in which the hand moves little for much motion of the joints. It slows the whole motion down
to a third, so that the hand keeps its direction; beyond that, what is lost is lost in this direction alone, and all
others go on. Motion towards the singularity brakes before it, as before a joint limit. Motion out of it never fades:
where the arm is stretched, its joints move although the hand does not yet, since bending the elbow either way brings
the hand back.
"""
import math
from typing import NamedTuple

import numpy as np

from arm_kinematics.kernels.motion import tip_and_jacobian
from moveit_servo.compiled import compiled

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
# Share of a twist's square below which nothing of it is left: an arm of less than six joints lacks directions.
_NOTHING = 1e-18


class WantedMotion(NamedTuple):
    """velocity (k,) of the joints; metric (k, k): how much a deviation from it counts; lost, share of the twist that a
    singularity takes of what the joints can do, 0 to 1, and 1 where they can do nothing of it; condition: ratio of the
    largest singular value to the least."""

    velocity: np.ndarray
    metric: np.ndarray
    lost: float
    condition: float


class ServoArm(NamedTuple):
    """An arm, and the rows of twists that count: rotations, offsets, prismatic of arm_kinematics.Chain.arrays; turn
    (3, 3) from the chain's base to the axes of the twist; keep (r,) rows; lower, upper, velocity (k,) as in
    JointLimits."""

    rotations: np.ndarray
    offsets: np.ndarray
    prismatic: np.ndarray
    turn: np.ndarray
    keep: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray


class Thresholds(NamedTuple):
    """Condition numbers: from which a direction is singular, and at which motion towards the singularity ends."""

    lower: float
    hard: float


@compiled
def jacobian_of(arm, q):
    """Return the Jacobian (r, k) of an ServoArm at ``q`` (k,), in the rows that count."""
    whole = tip_and_jacobian(arm.rotations, arm.offsets, arm.prismatic, q)[1]
    rows, k = len(arm.keep), len(q)
    jacobian = np.empty((rows, k))
    for i in range(rows):
        row = arm.keep[i]
        first = row - row % 3
        for j in range(k):
            jacobian[i, j] = (arm.turn[row % 3, 0] * whole[first, j] + arm.turn[row % 3, 1] * whole[first + 1, j]
                              + arm.turn[row % 3, 2] * whole[first + 2, j])
    return jacobian


@compiled
def velocity_for(twist, jacobian, arm, q, thresholds):
    """Return the WantedMotion joint velocities for ``twist`` (r,), the rows of an ServoArm that count.

    jacobian (r, k): that of the ServoArm at ``q`` (k,). thresholds: Thresholds.
    """
    left, values, right = np.linalg.svd(jacobian)
    rank, k, rows = len(values), len(q), len(twist)
    fading, gone = values[0] / max(thresholds.lower, 1.0), values[0] / max(thresholds.hard, thresholds.lower, 1.0)
    velocity, metric = np.zeros(k), np.zeros((k, k))
    size, lost = 0.0, 0.0
    for i in range(rank):
        part, value, along = 0.0, values[i], right[i]
        for a in range(rows):
            part += left[a, i] * twist[a]
        if value >= fading or abs(part) < 1e-9:
            rate = part / max(value, gone)
        else:
            most = math.inf
            for a in range(k):
                most = min(most, arm.velocity[a] / max(abs(along[a]), 1e-6))
            rate = _singular_rate(part, value, left[:, i], along, arm, q, gone)
            rate = min(max(rate, -_MAX_SLOWING * most), _MAX_SLOWING * most)
        size += part * part
        lost += (part - value * rate) ** 2
        weight = max(value, _MIN_WEIGHT * values[0]) ** 2
        for a in range(k):
            velocity[a] += rate * along[a]
            for b in range(k):
                metric[a, b] += weight * along[a] * along[b]
    if k > rank:
        effort = min(1.0, math.sqrt(np.sum(velocity * velocity)) / _POSTURE_FULL_AT)
        away = _away_from_limits(q, arm.lower, arm.upper)
        for i in range(rank, k):
            along, share = right[i], 0.0
            for a in range(k):
                share += along[a] * away[a]
            for a in range(k):
                velocity[a] += effort * share * along[a]
                for b in range(k):
                    metric[a, b] += (_FREE_WEIGHT * values[0]) ** 2 * along[a] * along[b]
    whole = np.sum(twist * twist)
    share = math.sqrt(lost / size) if size > _NOTHING * whole else 1.0 if whole > 0.0 else 0.0
    return WantedMotion(velocity, metric, share, values[0] / max(values[-1], 1e-12))


@compiled
def _singular_rate(part, value, of_hand, of_joints, arm, q, gone):
    """The rate along a singular direction of the joints, of which the hand's motion is ``part`` / ``value``."""
    probe = _PROBE_RAD * of_joints
    difference = jacobian_of(arm, q + probe) - jacobian_of(arm, q - probe)
    change = 0.0
    for a in range(len(of_hand)):
        for b in range(len(q)):
            change += of_hand[a] * difference[a, b] * of_joints[b]
    change /= 2.0 * _PROBE_RAD
    towards = math.copysign(1.0, part)
    if towards * change < -_LEVEL:
        return towards * min(abs(part) / max(value, gone), max(value - gone, 0.0) / abs(change) / _BRAKING_S)
    rate = part / max(value, gone)
    if abs(change) > _LEVEL:
        pocket = value / abs(change) + _room(q, towards * of_joints, arm.lower, arm.upper)
        if pocket < _POCKET_RAD < _room(q, -towards * of_joints, arm.lower, arm.upper):
            return -rate
    return rate


@compiled
def _room(q, direction, lower, upper):
    """How far ``q`` can move along ``direction`` before a joint is at its limit [rad]."""
    least = math.inf
    for a in range(len(q)):
        if abs(direction[a]) > 1e-3:
            room = upper[a] - q[a] if direction[a] > 0.0 else q[a] - lower[a]
            least = min(least, room / abs(direction[a]))
    return least


@compiled
def _away_from_limits(q, lower, upper):
    """Velocities (k,) away from limits that are near."""
    away = np.zeros(len(q))
    for a in range(len(q)):
        travel = upper[a] - lower[a]
        if 0.0 < travel < math.inf:
            zone = _POSTURE_SHARE * travel
            below, above = 1.0 - (q[a] - lower[a]) / zone, 1.0 - (upper[a] - q[a]) / zone
            away[a] = _POSTURE_SPEED * (min(max(below, 0.0), 1.0) - min(max(above, 0.0), 1.0))
    return away
