# SPDX-License-Identifier: BSD-3-Clause
"""The joint velocities that are possible: the nearest to those wanted within joint limits and before contacts."""
import math
from typing import NamedTuple

import numpy as np

from moveit_servo.compiled import compiled
from moveit_servo.limits import speed_towards
from moveit_servo.quadratic import nearest_within

#: Set-points lead the joints by at most this [rad], so that a blocked arm is not pushed harder and harder.
LEAD_RAD = 0.12
# Added to the diagonal of metrics, so that they are positive definite.
_REGULAR = 1e-6


class Rates(NamedTuple):
    """How bounds are approached: margin before joint limits [rad or m]; lag until braking begins, and time in which the
    arm stops [s]; clearance that remains before contacts [m], and times in which the way to it would be covered, before
    moving parts of the robot and before others [s]."""

    margin: float
    lag: float
    stopping_time: float
    clearance: float
    time_of_robot: float
    time_of_others: float


class Possible(NamedTuple):
    """velocity (k,); is_held: whether bounds changed it; low, high (k,): bounds of each joint; least (m,): of the gaps'
    change, slope @ velocity >= least; distance (m,): the gaps where the joints or the set-points are [m]."""

    velocity: np.ndarray
    is_held: bool
    low: np.ndarray
    high: np.ndarray
    least: np.ndarray
    distance: np.ndarray


@compiled
def possible(wanted, metric, joints, limits, near, rates):
    """Return the Possible that is nearest to ``wanted`` (k,) by ``metric`` (k, k); both are changed.

    joints: set-points (k,) and measured positions (k,), which they lead; limits: JointLimits; near: distance (m,),
    slope (m, k), drift (m,), of_robot (m,) as of ``surroundings.Near``; rates: Rates.
    """
    q, measured = joints
    gap, slope, drift, of_robot = near
    k, fastest = len(q), 1.0
    for a in range(k):
        fastest = max(fastest, abs(wanted[a]) / limits.velocity[a])
        metric[a, a] += _REGULAR
    lead = q - measured
    low = speed_towards(q - limits.lower - rates.margin, limits, rates.lag)
    high = speed_towards(limits.upper - rates.margin - q, limits, rates.lag)
    for a in range(k):
        wanted[a] /= fastest
        low[a] = -min(low[a], max(LEAD_RAD + lead[a], 0.0) / rates.stopping_time)
        high[a] = min(high[a], max(LEAD_RAD - lead[a], 0.0) / rates.stopping_time)
    least, distance = np.empty(len(gap)), np.empty(len(gap))
    for i in range(len(gap)):
        ahead = 0.0
        for a in range(k):
            ahead += slope[i, a] * lead[a]
        distance[i] = gap[i] - max(ahead, 0.0)
        time = rates.time_of_robot if of_robot[i] else rates.time_of_others
        least[i] = min(0.0, -max(distance[i] - rates.clearance, 0.0) / time - min(drift[i], 0.0))
    found = np.empty(k)
    held = nearest_within(wanted, metric, slope, least, low, high, found)
    return Possible(found, held, low, high, least, distance)


@compiled
def shares(jacobian, wanted, found, slope, bounds):
    """Return (taken, left, nearest): which shares of the motion ``wanted`` (k,) ``found`` (k,) lacks and has, by
    ``jacobian`` (r, k); the smallest gap whose bound holds it back [m], infinite without one. bounds: Possible."""
    size, lacks, has = 0.0, 0.0, 0.0
    for i in range(len(jacobian)):
        before, after = 0.0, 0.0
        for a in range(len(found)):
            before += jacobian[i, a] * wanted[a]
            after += jacobian[i, a] * found[a]
        size, lacks, has = size + before * before, lacks + (before - after) ** 2, has + after * after
    nearest = math.inf
    for i in range(len(bounds.least)):
        change = 0.0
        for a in range(len(found)):
            change += slope[i, a] * found[a]
        if change <= bounds.least[i] + 1e-4 + 1e-3 * abs(bounds.least[i]):
            nearest = min(nearest, bounds.distance[i])
    if size < 1e-18:
        return 0.0, 0.0, nearest
    return math.sqrt(lacks / size), math.sqrt(has / size), nearest
