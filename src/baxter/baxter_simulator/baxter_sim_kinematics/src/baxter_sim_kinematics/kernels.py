# SPDX-License-Identifier: BSD-3-Clause
"""Compiled inner loops: forward kinematics, Jacobian, and the search behind :func:`baxter_sim_kinematics.solve`.

A chain of n joints comes as plain arrays, every joint turned so that it moves about (or along) its own z axis:

- ``rotations`` (n + 1, 3, 3) and ``offsets`` (n + 1, 3) [m]: the constant pose of joint i's frame in the frame that
  joint i - 1 moves; the last entry leads from the last joint to the tip;
- ``prismatic`` (n,) bool; ``lower``, ``upper`` (n,) [rad or m], infinite where there is no limit.

A target comes as a rotation (3, 3) and a position (3,), with ``rows`` of the pose error that count: 6 all of it; 5
all but a turn about one axis; 3 the position alone. ``basis`` (3, 3) says which axis is free: see :func:`fill_basis`.

Positions are in metres and angles in radians, everything in the base frame. The functions keep no state and release the
GIL, so any number of threads may call them. Linear algebra is written out: the matrices are 7 x 7 at most, and numba's
``numpy.linalg`` would need scipy. All of it stands in one file because numba's cache on disk notices a change of the
file that a function is in, but not of the functions that it calls.
"""
import math

import numpy as np

from baxter_sim_kinematics import compile_cache

compile_cache.choose()

import numba  # noqa: E402  (numba reads where its cache lies when it is imported)

# Division as the processor does it, without a check each for a Python exception: a tenth faster, the same bits.
_compiled = numba.njit(cache=True, nogil=True, error_model="numpy")

# A pivot below this (the matrices are of order 1) means that a direction is lost.
_SINGULAR = 1e-14
# A joint this close to its limit [rad or m] is at its limit.
_TOUCHING = 1e-12


@_compiled
def place_joints(rotations, offsets, prismatic, q, axes, origins, rotation, position):
    """Forward kinematics; fills ``axes``, ``origins`` (n, 3) of the joints and the tip's ``rotation``, ``position``."""
    r00, r01, r02 = 1.0, 0.0, 0.0
    r10, r11, r12 = 0.0, 1.0, 0.0
    r20, r21, r22 = 0.0, 0.0, 1.0
    x, y, z = 0.0, 0.0, 0.0
    n = q.shape[0]
    for i in range(n + 1):
        ox, oy, oz = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        x += r00 * ox + r01 * oy + r02 * oz
        y += r10 * ox + r11 * oy + r12 * oz
        z += r20 * ox + r21 * oy + r22 * oz
        c = rotations[i]
        a00 = r00 * c[0, 0] + r01 * c[1, 0] + r02 * c[2, 0]
        a01 = r00 * c[0, 1] + r01 * c[1, 1] + r02 * c[2, 1]
        a02 = r00 * c[0, 2] + r01 * c[1, 2] + r02 * c[2, 2]
        a10 = r10 * c[0, 0] + r11 * c[1, 0] + r12 * c[2, 0]
        a11 = r10 * c[0, 1] + r11 * c[1, 1] + r12 * c[2, 1]
        a12 = r10 * c[0, 2] + r11 * c[1, 2] + r12 * c[2, 2]
        a20 = r20 * c[0, 0] + r21 * c[1, 0] + r22 * c[2, 0]
        a21 = r20 * c[0, 1] + r21 * c[1, 1] + r22 * c[2, 1]
        a22 = r20 * c[0, 2] + r21 * c[1, 2] + r22 * c[2, 2]
        if i == n:
            rotation[0, 0], rotation[0, 1], rotation[0, 2] = a00, a01, a02
            rotation[1, 0], rotation[1, 1], rotation[1, 2] = a10, a11, a12
            rotation[2, 0], rotation[2, 1], rotation[2, 2] = a20, a21, a22
            position[0], position[1], position[2] = x, y, z
            return
        if prismatic[i]:
            x += a02 * q[i]
            y += a12 * q[i]
            z += a22 * q[i]
            r00, r01, r10, r11, r20, r21 = a00, a01, a10, a11, a20, a21
        else:
            cosine, sine = math.cos(q[i]), math.sin(q[i])
            r00, r01 = a00 * cosine + a01 * sine, a01 * cosine - a00 * sine
            r10, r11 = a10 * cosine + a11 * sine, a11 * cosine - a10 * sine
            r20, r21 = a20 * cosine + a21 * sine, a21 * cosine - a20 * sine
        r02, r12, r22 = a02, a12, a22
        axes[i, 0], axes[i, 1], axes[i, 2] = a02, a12, a22
        origins[i, 0], origins[i, 1], origins[i, 2] = x, y, z


@_compiled
def fill_jacobian(prismatic, axes, origins, position, jacobian):
    """Geometric Jacobian (6, n) of the point ``position``: linear rows first, base frame."""
    for i in range(axes.shape[0]):
        ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
        if prismatic[i]:
            jacobian[0, i], jacobian[1, i], jacobian[2, i] = ax, ay, az
            jacobian[3, i], jacobian[4, i], jacobian[5, i] = 0.0, 0.0, 0.0
        else:
            dx, dy, dz = position[0] - origins[i, 0], position[1] - origins[i, 1], position[2] - origins[i, 2]
            jacobian[0, i] = ay * dz - az * dy
            jacobian[1, i] = az * dx - ax * dz
            jacobian[2, i] = ax * dy - ay * dx
            jacobian[3, i], jacobian[4, i], jacobian[5, i] = ax, ay, az


@_compiled
def joint_frames(rotations, offsets, prismatic, q):
    """Return the rotations (n + 1, 3, 3) and origins (n + 1, 3) of every joint's moved frame, and of the tip (last)."""
    n = q.shape[0]
    all_rotations, all_origins = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    turn, point = np.eye(3), np.zeros(3)
    for i in range(n + 1):
        for a in range(3):
            point[a] += turn[a, 0] * offsets[i, 0] + turn[a, 1] * offsets[i, 1] + turn[a, 2] * offsets[i, 2]
        for a in range(3):
            for b in range(3):
                all_rotations[i, a, b] = (turn[a, 0] * rotations[i, 0, b] + turn[a, 1] * rotations[i, 1, b]
                                          + turn[a, 2] * rotations[i, 2, b])
        turn[:] = all_rotations[i]
        if i < n:
            if prismatic[i]:
                point += turn[:, 2] * q[i]
            else:
                cosine, sine = math.cos(q[i]), math.sin(q[i])
                for a in range(3):
                    u, v = turn[a, 0], turn[a, 1]
                    turn[a, 0], turn[a, 1] = u * cosine + v * sine, v * cosine - u * sine
        all_rotations[i] = turn
        all_origins[i] = point
    return all_rotations, all_origins


@_compiled
def tip_and_jacobian(rotations, offsets, prismatic, q):
    """Return the tip's pose (4, 4) in the base frame and its Jacobian (6, n)."""
    n = q.shape[0]
    axes, origins = np.empty((n, 3)), np.empty((n, 3))
    rotation, position = np.empty((3, 3)), np.empty(3)
    pose, jacobian = np.zeros((4, 4)), np.empty((6, n))
    place_joints(rotations, offsets, prismatic, q, axes, origins, rotation, position)
    fill_jacobian(prismatic, axes, origins, position, jacobian)
    pose[:3, :3] = rotation
    pose[:3, 3] = position
    pose[3, 3] = 1.0
    return pose, jacobian


@_compiled
def fill_basis(target_rotation, axis, basis):
    """Fill ``basis`` (3, 3): its last row is the target's ``axis`` (3,), given in the tip's frame, the others
    complete it.

    For a target that leaves the turn about that axis free. Base frame; ``axis`` has length 1.
    """
    for a in range(3):
        basis[2, a] = (target_rotation[a, 0] * axis[0] + target_rotation[a, 1] * axis[1]
                       + target_rotation[a, 2] * axis[2])
    # The coordinate axis that is least along it is never parallel to it.
    k = 0
    for a in range(1, 3):
        if abs(basis[2, a]) < abs(basis[2, k]):
            k = a
    length = math.sqrt(1.0 - basis[2, k] ** 2)
    for a in range(3):
        basis[0, a] = ((1.0 if a == k else 0.0) - basis[2, k] * basis[2, a]) / length
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        basis[1, a] = basis[2, b] * basis[0, c] - basis[2, c] * basis[0, b]


@_compiled
def fill_error(rotation, position, target_rotation, target_position, rows, basis, error):
    """Pose error: translation [m], then the rotation vector [rad] that turns the tip into the target; base frame.

    With 5 rows the rotation is the smallest that turns the tip's free axis into the target's; it has no part along that
    axis, so that its components along the first two rows of ``basis`` are all of it.
    """
    for a in range(3):
        error[a] = target_position[a] - position[a]
    m = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            m[a, b] = (target_rotation[a, 0] * rotation[b, 0] + target_rotation[a, 1] * rotation[b, 1]
                       + target_rotation[a, 2] * rotation[b, 2])
    if rows == 5:
        # The tip's axis now, along the rows of the basis: the third is the target's axis.
        now = np.empty(3)
        for a in range(3):
            total = 0.0
            for b in range(3):
                for c in range(3):
                    total += basis[a, c] * m[b, c] * basis[2, b]
            now[a] = total
        sine = math.sqrt(now[0] * now[0] + now[1] * now[1])
        angle = math.atan2(sine, now[2])
        scale = angle / sine if sine > 1e-9 else 1.0
        error[3], error[4], error[5] = scale * now[1], -scale * now[0], 0.0
        if sine <= 1e-9 and now[2] < 0.0:
            error[3], error[4] = math.pi, 0.0
        return
    x, y, z = 0.5 * (m[2, 1] - m[1, 2]), 0.5 * (m[0, 2] - m[2, 0]), 0.5 * (m[1, 0] - m[0, 1])
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (m[0, 0] + m[1, 1] + m[2, 2] - 1.0)
    angle = math.atan2(sine, cosine)
    if sine > 1e-6:
        scale = angle / sine
        error[3], error[4], error[5] = scale * x, scale * y, scale * z
    elif cosine > 0.0:
        error[3], error[4], error[5] = x, y, z
    else:
        # Half a turn: the antisymmetric part vanishes, the axis is the largest column of m + 1.
        k = 0
        for a in range(1, 3):
            if m[a, a] > m[k, k]:
                k = a
        m[k, k] += 1.0
        scale = angle / math.sqrt(m[0, k] ** 2 + m[1, k] ** 2 + m[2, k] ** 2)
        error[3], error[4], error[5] = scale * m[0, k], scale * m[1, k], scale * m[2, k]


@_compiled
def _fill_task_jacobian(prismatic, axes, origins, position, rows, basis, jacobian):
    """:func:`fill_jacobian`, its angular rows along ``basis`` where a turn is free."""
    fill_jacobian(prismatic, axes, origins, position, jacobian)
    if rows == 5:
        for i in range(jacobian.shape[1]):
            x, y, z = jacobian[3, i], jacobian[4, i], jacobian[5, i]
            for a in range(3):
                jacobian[3 + a, i] = basis[a, 0] * x + basis[a, 1] * y + basis[a, 2] * z


@_compiled
def _length(vector, start, stop):
    total = 0.0
    for i in range(start, stop):
        total += vector[i] * vector[i]
    return math.sqrt(total)


@_compiled
def _factorise(matrix, size):
    """Cholesky factor in place (lower triangle); a direction that is lost gets an infinite pivot, so it stays still."""
    for j in range(size):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = math.sqrt(pivot) if pivot > _SINGULAR else math.inf
        inverse = 1.0 / matrix[j, j]
        for i in range(j + 1, size):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value * inverse


@_compiled
def _back_substitute(factor, size, vector):
    """Solve in place with the factor of :func:`_factorise`."""
    for i in range(size):
        value = vector[i]
        for k in range(i):
            value -= factor[i, k] * vector[k]
        vector[i] = value / factor[i, i]
    for i in range(size - 1, -1, -1):
        value = vector[i]
        for k in range(i + 1, size):
            value -= factor[k, i] * vector[k]
        vector[i] = value / factor[i, i]


@_compiled
def _damp(jacobian, rows, damping, normal, step):
    """Turn ``step`` (n,), the slope J^T e on entry, into (J^T J + damping I)^-1 J^T e; ``normal`` (n, n) is space."""
    n = step.shape[0]
    for i in range(n):
        for j in range(i + 1):
            value = 0.0
            for row in range(rows):
                value += jacobian[row, i] * jacobian[row, j]
            normal[i, j] = value
        normal[i, i] += damping
    _factorise(normal, n)
    _back_substitute(normal, n, step)


@_compiled
def _reach(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, rows, basis, tolerance_m,
           tolerance_rad, max_iterations, q, best):
    """Levenberg-Marquardt from ``q`` (changed in place) towards the target, inside the limits.

    ``best`` gets the visited posture with the least error. Returns
    (solved, iterations, least error). The damping is the squared error itself (Sugihara, "Solvability-unconcerned
    inverse kinematics by the Levenberg-Marquardt method", IEEE T-RO 27(5), 2011): bold when near, careful when far.
    """
    n = q.shape[0]
    axes, origins = np.empty((n, 3)), np.empty((n, 3))
    rotation, position = np.empty((3, 3)), np.empty(3)
    jacobian, error = np.empty((6, n)), np.empty(6)
    normal, step = np.empty((n, n)), np.empty(n)
    least, mark = math.inf, math.inf
    best[:] = q
    for iteration in range(max_iterations):
        place_joints(rotations, offsets, prismatic, q, axes, origins, rotation, position)
        fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
        size = _length(error, 0, rows)
        if size < least:
            least = size
            best[:] = q
        if _length(error, 0, 3) <= tolerance_m and (rows == 3 or _length(error, 3, rows) <= tolerance_rad):
            best[:] = q
            return True, iteration, size
        if iteration % 8 == 7:
            # A start that does not pay is left early: the next one costs less than waiting.
            if least > 0.7 * mark:
                return False, iteration + 1, least
            mark = least
        _fill_task_jacobian(prismatic, axes, origins, position, rows, basis, jacobian)
        damping = 0.5 * size * size + 1e-12
        for i in range(n):
            slope = 0.0
            for row in range(rows):
                slope += jacobian[row, i] * error[row]
            if (q[i] <= lower[i] and slope < 0.0) or (q[i] >= upper[i] and slope > 0.0):
                # At its limit and pushed outwards: this joint sits out this step.
                for row in range(rows):
                    jacobian[row, i] = 0.0
                slope = 0.0
            step[i] = slope
        _damp(jacobian, rows, damping, normal, step)
        for i in range(n):
            q[i] = min(max(q[i] + step[i], lower[i]), upper[i])
    return False, max_iterations, least


@_compiled
def _distance(a, b):
    total = 0.0
    for i in range(a.shape[0]):
        total += (a[i] - b[i]) ** 2
    return math.sqrt(total)


@_compiled
def _walk(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, rows, basis, tolerance_m,
          tolerance_rad, max_iterations, seed, q, best):
    """Walk from the solution ``q`` towards ``seed`` without leaving the target: down the distance, in the null space.

    ``best`` (a solution on entry) gets the nearest solution met. Returns the iterations used. Each step is the
    minimum-norm correction of the pose error plus the part of (seed - q) that the tip does not feel, scaled by the
    step length that the last two steps suggest (Barzilai and Borwein, IMA J. Numer. Anal. 8, 1988).
    """
    n = q.shape[0]
    axes, origins = np.empty((n, 3)), np.empty((n, 3))
    rotation, position = np.empty((3, 3)), np.empty(3)
    jacobian, error = np.empty((6, n)), np.empty(6)
    gram, pull, correction, drift = np.empty((6, 6)), np.empty(6), np.empty(6), np.empty(n)
    last_q, last_drift, fix = np.empty(n), np.zeros(n), np.empty(n)
    nearest = _distance(best, seed)
    gain, longest, taken = 1.0, 0.4, 0.0
    for iteration in range(max_iterations):
        place_joints(rotations, offsets, prismatic, q, axes, origins, rotation, position)
        fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
        on_target = _length(error, 0, 3) <= tolerance_m and (rows == 3 or _length(error, 3, rows) <= tolerance_rad)
        if on_target:
            distance = _distance(q, seed)
            if distance < nearest:
                nearest = distance
                best[:] = q
        _fill_task_jacobian(prismatic, axes, origins, position, rows, basis, jacobian)
        # Joints that the step would push through their limit are taken out one round at a time.
        for _ in range(n):
            for row in range(rows):
                for column in range(row + 1):
                    value = 0.0
                    for i in range(n):
                        value += jacobian[row, i] * jacobian[column, i]
                    gram[row, column] = value
                gram[row, row] += 1e-10
                correction[row] = error[row]
                value = 0.0
                for i in range(n):
                    value += jacobian[row, i] * (seed[i] - q[i])
                pull[row] = value
            _factorise(gram, rows)
            _back_substitute(gram, rows, correction)
            _back_substitute(gram, rows, pull)
            taken_out = False
            for i in range(n):
                moves = False
                drift[i], fix[i] = seed[i] - q[i], 0.0
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
        size, strayed = _length(drift, 0, n), _length(fix, 0, n)
        if size < 1e-5 and on_target:
            if _distance(q, seed) < nearest + 1e-4:
                best[:] = q
            return iteration
        if strayed > 0.3 * taken and taken > 1e-6:
            # Near a singularity the way bends sharply: back, and on in shorter steps.
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
        # The tip leaves the target with the square of the step: keep steps short, and inside the limits.
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


@_compiled
def _mix(state):
    """One step of splitmix64 (Steele, Lea, Flood, OOPSLA 2014): returns (new state, 64 mixed bits)."""
    state += np.uint64(0x9E3779B97F4A7C15)
    z = state
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state, z ^ (z >> np.uint64(31))


@_compiled
def _stir(state, values):
    for bits in values.view(np.uint64):
        state, mixed = _mix(state ^ bits)
        state ^= mixed
    return state


@_compiled
def split_pose(pose, allowed, rotation, position):
    """Copy a pose (4, 4) into ``rotation`` (3, 3), made exactly orthonormal, and ``position`` (3,).

    Returns False when a number is not finite or the rotation is off by more than ``allowed`` in any product of columns.
    """
    gram, rounded = np.empty((3, 3)), np.empty((3, 3))
    for a in range(3):
        position[a] = pose[a, 3]
        for b in range(3):
            rotation[a, b] = pose[a, b]
    if not math.isfinite(position[0] + position[1] + position[2]):
        return False
    while True:
        error = 0.0
        for a in range(3):
            for b in range(3):
                gram[a, b] = (rotation[0, a] * rotation[0, b] + rotation[1, a] * rotation[1, b]
                              + rotation[2, a] * rotation[2, b])
                off = abs(gram[a, b] - (1.0 if a == b else 0.0))
                if not off <= allowed:
                    return False
                error = max(error, off)
        if error < 1e-12:
            break
        # Newton's iteration for the nearest rotation; each round squares the error.
        for a in range(3):
            for b in range(3):
                rounded[a, b] = 1.5 * rotation[a, b] - 0.5 * (
                    rotation[a, 0] * gram[0, b] + rotation[a, 1] * gram[1, b] + rotation[a, 2] * gram[2, b])
        rotation[:] = rounded
    determinant = (rotation[0, 0] * (rotation[1, 1] * rotation[2, 2] - rotation[1, 2] * rotation[2, 1])
                   - rotation[0, 1] * (rotation[1, 0] * rotation[2, 2] - rotation[1, 2] * rotation[2, 0])
                   + rotation[0, 2] * (rotation[1, 0] * rotation[2, 1] - rotation[1, 1] * rotation[2, 0]))
    return determinant > 0.0


@_compiled
def _clamped(seed, lower, upper):
    inside = np.empty(seed.shape[0])
    for i in range(seed.shape[0]):
        inside[i] = min(max(seed[i], lower[i]), upper[i])
    return inside


@_compiled
def _fill_start(attempt, state, lower, upper, seed, start):
    """Fill ``start`` (n,) with the posture that attempt number ``attempt`` begins at: the seed first, then random ones.

    Depends on nothing but the arguments: ``state`` comes from the request, so the same request gives the same starts,
    and a search can be taken up at any attempt.
    """
    n = seed.shape[0]
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


@_compiled
def _turn_towards(prismatic, lower, upper, goal, q):
    """A joint without limits: of its many equal angles take the one nearest ``goal``."""
    for i in range(q.shape[0]):
        if not prismatic[i] and lower[i] == -math.inf and upper[i] == math.inf:
            q[i] -= 2.0 * math.pi * round((q[i] - goal[i]) / (2.0 * math.pi))


@_compiled
def search(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, seed, goal, rows, basis,
           tolerance_m, tolerance_rad, max_iterations, max_starts, wanted, solution):
    """Look for postures that put the tip on the target, and keep the one nearest ``goal`` (n,).

    The first start is the seed, the others are random postures inside the limits whose generator is seeded by the
    request itself, so the same request gives the same answer bit for bit. Ends after ``wanted`` starts that arrived.

    ``solution`` (n,) gets the answer, or the best attempt. Returns (starts that arrived, starts, iterations, the
    solution's pose error [m], [rad]).
    """
    n = seed.shape[0]
    q, best, start = np.empty(n), np.empty(n), np.empty(n)
    seed, goal = _clamped(seed, lower, upper), _clamped(goal, lower, upper)
    state = _stir(_stir(_stir(np.uint64(n), target_position), target_rotation.ravel()), seed)
    found, starts, iterations, least, nearest = 0, 0, 0, math.inf, math.inf
    for attempt in range(max_starts):
        starts += 1
        _fill_start(attempt, state, lower, upper, seed, start)
        q[:] = start
        solved, used, size = _reach(rotations, offsets, prismatic, lower, upper, target_rotation, target_position,
                                    rows, basis, tolerance_m, tolerance_rad, max_iterations, q, best)
        iterations += used
        if solved:
            _turn_towards(prismatic, lower, upper, goal, best)
            q[:] = best
            iterations += _walk(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, rows,
                                basis, tolerance_m, tolerance_rad, max_iterations, goal, q, best)
            found += 1
            distance = _distance(best, goal)
            if distance < nearest:
                nearest = distance
                solution[:] = best
            if found >= wanted:
                break
        elif found == 0 and size < least:
            least = size
            solution[:] = best
    error_m, error_rad = pose_error(rotations, offsets, prismatic, target_rotation, target_position, rows, basis,
                                    solution)
    return found, starts, iterations, error_m, error_rad


@_compiled
def pose_error(rotations, offsets, prismatic, target_rotation, target_position, rows, basis, q):
    """Return the pose error of the posture ``q``: [m], [rad]."""
    n = q.shape[0]
    axes, origins = np.empty((n, 3)), np.empty((n, 3))
    rotation, position, error = np.empty((3, 3)), np.empty(3), np.empty(6)
    place_joints(rotations, offsets, prismatic, q, axes, origins, rotation, position)
    fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
    return _length(error, 0, 3), _length(error, 3, 6)


@_compiled
def search_many(rotations, offsets, prismatic, lower, upper, target_rotations, target_positions, seeds, goals, rows,
                bases, tolerance_m, tolerance_rad, max_iterations, max_starts, wanted, first, last, solutions,
                outcomes):
    """:func:`search` for the targets ``first`` to ``last`` - 1 of arrays with one entry a target.

    Fills their rows of ``solutions`` (m, n) and ``outcomes`` (m, 5): what search returns.
    """
    for k in range(first, last):
        found, starts, iterations, error_m, error_rad = search(
            rotations, offsets, prismatic, lower, upper, target_rotations[k], target_positions[k], seeds[k], goals[k],
            rows, bases[k], tolerance_m, tolerance_rad, max_iterations, max_starts, wanted, solutions[k])
        outcomes[k, 0], outcomes[k, 1], outcomes[k, 2] = found, starts, iterations
        outcomes[k, 3], outcomes[k, 4] = error_m, error_rad


@_compiled
def gather(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, seed, goal, rows, basis,
           tolerance_m, tolerance_rad, max_iterations, first_start, max_starts, walked, apart, held, solutions):
    """Collect solutions of one target that differ: in at least one joint by ``apart`` [rad or m] from each other.

    Starts number ``first_start`` to ``max_starts`` - 1 of those that :func:`search` would try, until ``solutions``
    (m, n), of which the first ``held`` rows hold some already, is full. With ``walked`` each is taken along its
    self-motion to where it is nearest ``goal``; of two that are the same the first stays.
    Returns (rows filled, starts, iterations).
    """
    n = seed.shape[0]
    q, best, start = np.empty(n), np.empty(n), np.empty(n)
    seed, goal = _clamped(seed, lower, upper), _clamped(goal, lower, upper)
    state = _stir(_stir(_stir(np.uint64(n), target_position), target_rotation.ravel()), seed)
    starts, iterations = 0, 0
    for attempt in range(first_start, max_starts):
        if held >= solutions.shape[0]:
            break
        starts += 1
        _fill_start(attempt, state, lower, upper, seed, start)
        q[:] = start
        solved, used, _ = _reach(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, rows,
                                 basis, tolerance_m, tolerance_rad, max_iterations, q, best)
        iterations += used
        if not solved:
            continue
        _turn_towards(prismatic, lower, upper, goal, best)
        if walked:
            q[:] = best
            iterations += _walk(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, rows,
                                basis, tolerance_m, tolerance_rad, max_iterations, goal, q, best)
        new = True
        for k in range(held):
            gap = 0.0
            for i in range(n):
                gap = max(gap, abs(best[i] - solutions[k, i]))
            if gap < apart:
                new = False
                break
        if new:
            solutions[held] = best
            held += 1
    return held, starts, iterations


@_compiled
def nearest(rotations, offsets, prismatic, lower, upper, target_rotation, target_position, seed, rows, basis,
            metres_per_radian, max_iterations, max_starts, solution):
    """The posture inside the limits whose tip comes nearest to a target that cannot be reached.

    Near means sqrt(error [m]^2 + (metres_per_radian * error [rad])^2). Levenberg-Marquardt that only ever takes steps
    downhill (the damping follows Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05), from the seed
    and from random postures. Fills ``solution`` (n,); returns its pose error [m], [rad].
    """
    n = seed.shape[0]
    axes, origins = np.empty((n, 3)), np.empty((n, 3))
    rotation, position = np.empty((3, 3)), np.empty(3)
    jacobian, error = np.empty((6, n)), np.empty(6)
    normal, step, slope, q, tried = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    seed = _clamped(seed, lower, upper)
    solution[:] = seed
    state = _stir(_stir(_stir(np.uint64(n), target_position), target_rotation.ravel()), seed)
    least = math.inf
    for attempt in range(max_starts):
        _fill_start(attempt, state, lower, upper, seed, q)
        damping, growth, cost = 1e-2, 2.0, math.inf
        tried[:] = q
        for _ in range(max_iterations):
            place_joints(rotations, offsets, prismatic, tried, axes, origins, rotation, position)
            fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
            for row in range(3, rows):
                error[row] *= metres_per_radian
            trial = _length(error, 0, rows) ** 2
            if trial < cost:
                gained = cost - trial
                cost = trial
                q[:] = tried
                damping, growth = max(damping * 0.3, 1e-9), 2.0
                if gained < 1e-10 * cost or cost < 1e-14:
                    break
                _fill_task_jacobian(prismatic, axes, origins, position, rows, basis, jacobian)
                for i in range(n):
                    for row in range(3, rows):
                        jacobian[row, i] *= metres_per_radian
                    slope[i] = 0.0
                    for row in range(rows):
                        slope[i] += jacobian[row, i] * error[row]
                    if (q[i] <= lower[i] and slope[i] < 0.0) or (q[i] >= upper[i] and slope[i] > 0.0):
                        jacobian[:, i], slope[i] = 0.0, 0.0
            else:
                damping, growth = damping * growth, growth * 2.0
                if damping > 1e6:
                    break
            step[:] = slope
            _damp(jacobian, rows, damping, normal, step)
            for i in range(n):
                tried[i] = min(max(q[i] + step[i], lower[i]), upper[i])
        if cost < least:
            least = cost
            solution[:] = q
    return pose_error(rotations, offsets, prismatic, target_rotation, target_position, rows, basis, solution)


@_compiled
def beyond_reach(target_rotation, target_position, shoulder, tip_reach_m, wrist_in_tip, wrist_reach_m):
    """Return how far the tip, and the wrist in this orientation, would be outside the balls around the shoulder [m]."""
    tip, wrist = 0.0, 0.0
    for a in range(3):
        from_shoulder = target_position[a] - shoulder[a]
        tip += from_shoulder * from_shoulder
        for b in range(3):
            from_shoulder -= target_rotation[a, b] * wrist_in_tip[b]
        wrist += from_shoulder * from_shoulder
    return math.sqrt(tip) - tip_reach_m, math.sqrt(wrist) - wrist_reach_m


@_compiled
def wrench(jacobian, torques, damping):
    """Damped least-squares wrench (6,) whose joint torques are ``torques``: (J J^T + damping^2) w = J torques."""
    n = torques.shape[0]
    gram, result = np.empty((6, 6)), np.empty(6)
    for row in range(6):
        result[row] = 0.0
        for i in range(n):
            result[row] += jacobian[row, i] * torques[i]
        for column in range(row + 1):
            value = 0.0
            for i in range(n):
                value += jacobian[row, i] * jacobian[column, i]
            gram[row, column] = value
        gram[row, row] += damping * damping
    _factorise(gram, 6)
    _back_substitute(gram, 6, result)
    return result
