# SPDX-License-Identifier: BSD-3-Clause
"""Descent from one start: to the target, damped or by Newton's steps, along the self-motion towards a posture, or as
near to the target as possible."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.kernels.compiled import compiled
from arm_kinematics.kernels.linear import back_substitute, damp, distance, factorise, fill_gram, length
from arm_kinematics.kernels.motion import place_joints
from arm_kinematics.kernels.starts import clamped, fill_start, state_of, turn_towards
from arm_kinematics.kernels.task import fill_error, fill_task_jacobian, on_target, pose_error, within, workspace

if TYPE_CHECKING:
    from arm_kinematics.kernels import Arm, Effort, Limits, TargetArrays

# Tried on 4,000 random poses of each of two arms. With less damping, starts arrive even sooner, but more often at a
# distant solution: at a quarter of this value, 3 in 1,000 starts that began 0.05 rad away; at this value none of 1,500.
_DAMPING = 0.2
# Where the vendor's simulator gives up, and where it stops: every component of the pose error [m] and [rad] below this.
_NEWTON_STEPS = 1000
_NEWTON_ARRIVED = 1e-2
# An arrived posture becomes exact within so many steps more, or hangs at a limit. In these steps the wrist, the last
# three joints, counts half: the arm corrects the error. The exact answer then is 1.66 mrad from the angles on Glasgow's
# sheet, which miss the pose by 0.9 mm (with 1 instead of 0.5, 2.28 mrad); no exact posture is nearer than 1.62. A seed
# that has arrived has no such steps behind it, and the nearest posture to it is wanted: all joints count.
_FINISHING_STEPS = 20
_WRIST_JOINTS, _WRIST_SHARE = 3, 0.5
# A joint this close to its limit [rad or m] is at its limit.
_TOUCHING = 1e-12


@compiled
def _fill_slope(jacobian: np.ndarray, error: np.ndarray, rows: int, limits: Limits, q: np.ndarray,
                slope: np.ndarray) -> None:
    """Fill ``slope`` (n,) with J^T e. A joint at its limit that is pushed outwards is excluded: its column becomes
    0."""
    lower, upper = limits
    for i in range(q.shape[0]):
        value = 0.0
        for row in range(rows):
            value += jacobian[row, i] * error[row]
        if (q[i] <= lower[i] and value < 0.0) or (q[i] >= upper[i] and value > 0.0):
            for row in range(rows):
                jacobian[row, i] = 0.0
            value = 0.0
        slope[i] = value


@compiled
def reach(arm: Arm, limits: Limits, target: TargetArrays, effort: Effort, q: np.ndarray,
          best: np.ndarray) -> tuple[bool, int, float]:
    """Levenberg-Marquardt from ``q`` (changed in place) towards the target, inside the limits.

    ``best`` gets the visited posture with the least error. Returns (solved, iterations, least error). The damping is in
    proportion to the squared error (Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt
    method", IEEE T-RO 27(5), 2011): small damping near the target, large damping far from it.
    """
    n, (rotations, offsets, prismatic), (lower, upper) = q.shape[0], arm, limits
    target_rotation, target_position, rows, basis = target
    lines, rotation, position, jacobian, error = workspace(n)
    normal, step = np.empty((n, n)), np.empty(n)
    tolerance_m, tolerance_rad, max_iterations, _, _ = effort
    least, mark = math.inf, math.inf
    best[:] = q
    for iteration in range(max_iterations):
        place_joints(rotations, offsets, prismatic, q, lines, rotation, position)
        fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
        size = length(error, 0, rows)
        if size < least:
            least = size
            best[:] = q
        if on_target(error, rows, tolerance_m, tolerance_rad):
            best[:] = q
            return True, iteration, size
        if iteration % 8 == 7:
            # A start without progress is given up early: the next one is cheaper than waiting.
            if least > 0.7 * mark:
                return False, iteration + 1, least
            mark = least
        fill_task_jacobian(prismatic, lines, position, rows, basis, jacobian)
        _fill_slope(jacobian, error, rows, limits, q, step)
        damp(jacobian, rows, _DAMPING * size * size + 1e-12, normal, step)
        for i in range(n):
            q[i] = min(max(q[i] + step[i], lower[i]), upper[i])
    return False, max_iterations, least


@compiled
def newton(arm: Arm, limits: Limits, target: TargetArrays, effort: Effort, seed: np.ndarray,
           q: np.ndarray) -> tuple[int, bool]:
    """Newton's steps with the pseudo-inverse from ``seed`` (n,), each cut off at the limits, as KDL's
    ChainIkSolverPos_NR_JL makes them; then, from where they arrive, to the tolerances of ``effort``.

    ``q`` (n,) gets the last posture. Returns (steps to the arrival, -1 without one; whether the posture is exact).
    """
    n, (rotations, offsets, prismatic), (lower, upper) = q.shape[0], arm, limits
    target_rotation, target_position, rows, basis = target
    lines, rotation, position, jacobian, error = workspace(n)
    gram, inside = np.empty((6, 6)), clamped(seed, limits)
    tolerance_m, tolerance_rad, _, _, _ = effort
    arrived, last, share = -1, _NEWTON_STEPS - 1, 1.0
    q[:] = inside
    for step in range(_NEWTON_STEPS + _FINISHING_STEPS):
        place_joints(rotations, offsets, prismatic, q, lines, rotation, position)
        fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
        if arrived < 0 and within(error, rows, _NEWTON_ARRIVED):
            arrived, last, share = step, step + _FINISHING_STEPS, _WRIST_SHARE if step > 0 else 1.0
        if arrived >= 0 and on_target(error, rows, tolerance_m, tolerance_rad):
            turn_towards(arm, limits, inside, q)
            return arrived, True
        if step >= last:
            break
        fill_task_jacobian(prismatic, lines, position, rows, basis, jacobian)
        for i in range(max(n - _WRIST_JOINTS, 0), n):
            for row in range(rows):
                jacobian[row, i] *= share
        fill_gram(jacobian, rows, 0.0, gram)
        factorise(gram, rows)
        back_substitute(gram, rows, error)
        for i in range(n):
            move = 0.0
            for row in range(rows):
                move += jacobian[row, i] * error[row]
            if i >= n - _WRIST_JOINTS:
                move *= share
            q[i] = min(max(q[i] + move, lower[i]), upper[i])
    solved = False
    if arrived >= 0:  # it hangs at a limit
        inside[:] = q
        solved, _, _ = reach(arm, limits, target, effort, inside, q)
    return arrived, solved


@compiled
def _fill_drift(jacobian: np.ndarray, error: np.ndarray, rows: int, limits: Limits, preferred: np.ndarray,
                q: np.ndarray, room: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]) -> None:
    """Of ``room``, (gram (6, 6), pull (6,), correction (6,), drift (n,), fix (n,)), fill fix, the minimum-norm
    correction of the pose error, and drift, the part of (preferred - q) that does not move the tip.

    Joints that the drift would push through their limit are excluded, one round at a time: their columns become 0.
    """
    n, (lower, upper), (gram, pull, correction, drift, fix) = q.shape[0], limits, room
    for _ in range(n):
        fill_gram(jacobian, rows, 1e-10, gram)
        for row in range(rows):
            correction[row] = error[row]
            value = 0.0
            for i in range(n):
                value += jacobian[row, i] * (preferred[i] - q[i])
            pull[row] = value
        factorise(gram, rows)
        back_substitute(gram, rows, correction)
        back_substitute(gram, rows, pull)
        taken_out = False
        for i in range(n):
            moves = False
            drift[i], fix[i] = preferred[i] - q[i], 0.0
            for row in range(rows):
                moves = moves or jacobian[row, i] != 0.0
                drift[i] -= jacobian[row, i] * pull[row]
                fix[i] += jacobian[row, i] * correction[row]
            if not moves and (q[i] <= lower[i] or q[i] >= upper[i]):
                drift[i], fix[i] = 0.0, 0.0
        for i in range(n):
            if (q[i] <= lower[i] and drift[i] < -1e-9) or (q[i] >= upper[i] and drift[i] > 1e-9):
                for row in range(rows):
                    jacobian[row, i] = 0.0
                taken_out = True
        if not taken_out:
            break


@compiled
def walk(arm: Arm, limits: Limits, target: TargetArrays, effort: Effort, preferred: np.ndarray, q: np.ndarray,
         best: np.ndarray) -> int:
    """Walk from the solution ``q`` towards ``preferred`` in the null space, so that the tip stays on the target.

    ``best`` (a solution on entry) gets the nearest solution found. Returns the iterations used. Each step is the drift
    of :func:`_fill_drift`, scaled by the step length of the last two steps (Barzilai and Borwein, IMA J. Numer. Anal.
    8, 1988).
    """
    n, (rotations, offsets, prismatic), (lower, upper) = q.shape[0], arm, limits
    target_rotation, target_position, rows, basis = target
    lines, rotation, position, jacobian, error = workspace(n)
    drift, last_q, last_drift, fix = np.empty(n), np.empty(n), np.zeros(n), np.empty(n)
    room = (np.empty((6, 6)), np.empty(6), np.empty(6), drift, fix)
    tolerance_m, tolerance_rad, max_iterations, _, _ = effort
    closest = distance(best, preferred)
    gain, longest, taken = 1.0, 0.4, 0.0
    for iteration in range(max_iterations):
        place_joints(rotations, offsets, prismatic, q, lines, rotation, position)
        fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
        there = on_target(error, rows, tolerance_m, tolerance_rad)
        if there:
            gap = distance(q, preferred)
            if gap < closest:
                closest = gap
                best[:] = q
        fill_task_jacobian(prismatic, lines, position, rows, basis, jacobian)
        _fill_drift(jacobian, error, rows, limits, preferred, q, room)
        size, strayed = length(drift, 0, n), length(fix, 0, n)
        if size < 1e-5 and there:
            if distance(q, preferred) < closest + 1e-4:
                best[:] = q
            return iteration
        if strayed > 0.3 * taken and taken > 1e-6:
            # Near a singularity the curve bends sharply: go back and use shorter steps.
            q[:] = last_q
            longest, taken = 0.25 * taken, 0.0
            continue
        longest = min(1.5 * longest, 0.4)
        if iteration > 0:
            change, curve = 0.0, 0.0
            for i in range(n):
                change += (q[i] - last_q[i]) ** 2
                curve += (q[i] - last_q[i]) * (last_drift[i] - drift[i])
            gain = min(max(change / curve, 0.1), 4.0) if curve > 1e-16 else 1.0
        # The pose error grows with the square of the step: keep steps short, and inside the limits.
        scale = gain
        if size * scale > longest:
            scale = longest / size
        for i in range(n):
            if drift[i] > 0.0:
                scale = min(scale, max(upper[i] - q[i] - fix[i], 0.0) / drift[i])
            elif drift[i] < 0.0:
                scale = min(scale, min(lower[i] - q[i] - fix[i], 0.0) / drift[i])
        last_q[:] = q
        last_drift[:] = drift
        taken = scale * size
        for i in range(n):
            q[i] += fix[i] + scale * drift[i]
            if q[i] < lower[i] + _TOUCHING:
                q[i] = lower[i]
            elif q[i] > upper[i] - _TOUCHING:
                q[i] = upper[i]
    return max_iterations


@compiled
def _approach(arm: Arm, limits: Limits, target: TargetArrays, metres_per_radian: float, max_iterations: int,
              q: np.ndarray) -> float:
    """Take ``q`` (changed in place) to a local minimum of the tip's distance to the target; returns the squared error
    [m^2].

    Levenberg-Marquardt that only accepts steps downhill; the damping follows Nielsen, "Damping parameter in Marquardt's
    method", IMM-REP-1999-05.
    """
    n, (rotations, offsets, prismatic), (lower, upper) = q.shape[0], arm, limits
    target_rotation, target_position, rows, basis = target
    lines, rotation, position, jacobian, error = workspace(n)
    normal, step, slope, tried = np.empty((n, n)), np.empty(n), np.empty(n), q.copy()
    damping, growth, cost = 1e-2, 2.0, math.inf
    for _ in range(max_iterations):
        place_joints(rotations, offsets, prismatic, tried, lines, rotation, position)
        fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
        for row in range(3, rows):
            error[row] *= metres_per_radian
        trial = length(error, 0, rows) ** 2
        if trial < cost:
            gained = cost - trial
            cost = trial
            q[:] = tried
            damping, growth = max(damping * 0.3, 1e-9), 2.0
            if gained < 1e-10 * cost or cost < 1e-14:
                break
            fill_task_jacobian(prismatic, lines, position, rows, basis, jacobian)
            for i in range(n):
                for row in range(3, rows):
                    jacobian[row, i] *= metres_per_radian
            _fill_slope(jacobian, error, rows, limits, q, slope)
        else:
            damping, growth = damping * growth, growth * 2.0
            if damping > 1e6:
                break
        step[:] = slope
        damp(jacobian, rows, damping, normal, step)
        for i in range(n):
            tried[i] = min(max(q[i] + step[i], lower[i]), upper[i])
    return cost


@compiled
def nearest(arm: Arm, limits: Limits, target: TargetArrays, effort: Effort, metres_per_radian: float, seed: np.ndarray,
            solution: np.ndarray) -> tuple[float, float]:
    """The posture inside the limits whose tip comes nearest to a target that cannot be reached.

    Near means sqrt(error [m]^2 + (metres_per_radian * error [rad])^2). Searched from the seed and from random postures.
    Fills ``solution`` (n,); returns its pose error [m], [rad].
    """
    q, seed = np.empty(seed.shape[0]), clamped(seed, limits)
    _, _, max_iterations, max_starts, _ = effort
    solution[:] = seed
    state, least = state_of(target, seed), math.inf
    for attempt in range(max_starts):
        fill_start(attempt, state, limits, seed, q)
        cost = _approach(arm, limits, target, metres_per_radian, max_iterations, q)
        if cost < least:
            least = cost
            solution[:] = q
    return pose_error(arm, target, solution)
