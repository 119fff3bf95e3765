# SPDX-License-Identifier: BSD-3-Clause
"""The joint velocities nearest to those wanted that keep within bounds.

A small quadratic program. It begins at the velocities wanted, and takes in one violated bound after the other, dropping
those that no longer hold: the dual method of D. Goldfarb and A. Idnani, "A numerically stable dual method for solving
strictly convex quadratic programs", Mathematical Programming 27, 1983.
"""
import numpy as np

from moveit_servo.compiled import compiled

# Changes of the set of bounds that hold; a few suffice.
_MAX_CHANGES = 100
# Violations [m/s or rad/s] that are no longer mended, and those after the last change that do not shorten the motion.
_MENDED, _NO_MATTER = 1e-9, 1e-6
_PARALLEL = 1e-10


@compiled
def nearest_within(wanted, metric, slopes, least, low, high, found):
    """Write into ``found`` (k,) the x with ``slopes @ x >= least`` and ``low <= x <= high`` that is nearest to
    ``wanted`` (k,) by ``metric`` (k, k), symmetric and positive definite; return whether bounds changed anything.

    slopes (m, k), least (m,). x = 0 must be within all bounds. Should rounding keep the method from its end, the result
    is shortened, so that it keeps all bounds.
    """
    k, m = len(wanted), len(least)
    rows, limits = np.zeros((m + 2 * k, k)), np.empty(m + 2 * k)
    for i in range(m):
        size = 0.0
        for a in range(k):
            size += slopes[i, a] * slopes[i, a]
        size = max(np.sqrt(size), 1e-12)
        rows[i], limits[i] = slopes[i] / size, least[i] / size
    for a in range(k):
        rows[m + a, a], limits[m + a] = 1.0, low[a]
        rows[m + k + a, a], limits[m + k + a] = -1.0, -high[a]
    inverse = np.linalg.inv(metric)
    found[:] = wanted
    held, forces, count = np.empty(k, np.int64), np.zeros(k + 1), 0
    changed = False
    for _ in range(_MAX_CHANGES):
        worst, violation = -1, -_MENDED
        for i in range(m + 2 * k):
            value = -limits[i]
            for a in range(k):
                value += rows[i, a] * found[a]
            if value < violation:
                worst, violation = i, value
        if worst < 0:
            break
        changed = True
        count = _take_in((rows, limits, inverse), worst, found, (held, forces), count)
    if changed:
        _shorten(rows, limits, found)
        for a in range(k):  # to the last bit
            found[a] = min(max(found[a], low[a]), high[a])
    return changed


@compiled
def _take_in(problem, new, found, holding, count):
    """Move ``found`` until bound ``new`` holds; return how many then do. problem: rows, limits, inverse metric;
    holding: the bounds that hold, and how much each one pushes."""
    rows, limits, inverse = problem
    held, forces = holding
    force, k = 0.0, len(found)
    for _ in range(3 * k):
        direction = inverse @ rows[new]
        share = np.zeros(count)
        if count:
            normals = np.empty((count, k))
            for j in range(count):
                normals[j] = rows[held[j]]
            turned = normals @ inverse
            share = np.linalg.solve(turned @ normals.T + 1e-13 * np.eye(count), turned @ rows[new])
            direction = direction - turned.T @ share
        drop, most = -1, np.inf
        for j in range(count):
            if share[j] > 1e-12 and forces[j] / share[j] < most:
                drop, most = j, forces[j] / share[j]
        gain = direction @ rows[new]
        step = np.inf
        if gain > _PARALLEL * (rows[new] @ inverse @ rows[new]) and count < k:
            step = (limits[new] - rows[new] @ found) / gain
        if step == np.inf and drop < 0:
            return count
        move = min(step, most)
        if step < np.inf:
            for a in range(k):
                found[a] += move * direction[a]
        for j in range(count):
            forces[j] -= move * share[j]
        force += move
        if step <= most:
            held[count], forces[count] = new, force
            return count + 1
        for j in range(drop, count - 1):
            held[j], forces[j] = held[j + 1], forces[j + 1]
        count -= 1
    return count


@compiled
def _shorten(rows, limits, found):
    """Scale ``found`` down as far as a violated bound needs it."""
    share = 1.0
    for i in range(len(limits)):
        value = 0.0
        for a in range(len(found)):
            value += rows[i, a] * found[a]
        if value < limits[i] - _NO_MATTER:
            share = min(share, limits[i] / value)
    for a in range(len(found)):
        found[a] *= share
