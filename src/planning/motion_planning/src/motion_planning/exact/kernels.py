# SPDX-License-Identifier: BSD-3-Clause
"""Compiled search for shapes near each other: forward kinematics, then balls, then boxes.

Shapes that move with the robot ("movers", m) belong to links: links (m,) index, local (m, 4, 4) pose in the link,
centres (m, 3), halves (m, 3) and radii (m,) of their bounds. Fixed shapes (f) have rotations (f, 3, 3), centres (f, 3),
halves (f, 3), radii (f,) in the planning frame, sorted so that chunks of them lie together: starts (c + 1,), balls (c,
4) centre and radius of each chunk.
"""
import math
from pathlib import Path

import numpy as np

from disk_cache.compiled import compiler
from motion_planning.model import kernels as model_kernels
from motion_planning.model.kernels import fill_frames

compiled = compiler("motion_planning_exact", [Path(__file__), Path(model_kernels.__file__)], nogil=True,
                    error_model="numpy")


@compiled
def place(kinematics, q, base, movers, poses):
    """Fill ``poses`` (m, 4, 4) with the movers' poses; return their boxes: rotations (m, 3, 3), centres (m, 3)."""
    links, local, centres = movers[0], movers[1], movers[2]
    frames = np.empty((kinematics[0].shape[0], 4, 4))
    fill_frames(kinematics, q, base, frames)
    count = links.shape[0]
    rotations, places = np.empty((count, 3, 3)), np.empty((count, 3))
    for i in range(count):
        frame, inner, out = frames[links[i]], local[i], poses[i]
        for a in range(3):
            for b in range(4):
                value = frame[a, 0] * inner[0, b] + frame[a, 1] * inner[1, b] + frame[a, 2] * inner[2, b]
                out[a, b] = value + frame[a, 3] if b == 3 else value
            places[i, a] = (out[a, 0] * centres[i, 0] + out[a, 1] * centres[i, 1] + out[a, 2] * centres[i, 2]
                            + out[a, 3])
            for b in range(3):
                rotations[i, a, b] = out[a, b]
        out[3, 0], out[3, 1], out[3, 2], out[3, 3] = 0.0, 0.0, 0.0, 1.0
    return rotations, places


@compiled
def near(robot, movers, pairs, active, fixed, poses, out):
    """Fill ``out`` (o, 2) with what may touch; return how many rows there are, which may be more than ``out`` has.

    robot: kinematics, q, base. A row is two movers, or a mover and -1 - the fixed shape. pairs (p, 2): movers that are
    checked against each other; active (m,): movers that are checked against fixed shapes. Fills ``poses`` (m, 4, 4).
    """
    kinematics, q, base = robot
    rotations, places = place(kinematics, q, base, movers, poses)
    halves, radii = movers[3], movers[4]
    found = 0
    for p in range(pairs.shape[0]):
        i, j = pairs[p, 0], pairs[p, 1]
        reach = radii[i] + radii[j] + 1e-6
        if _square(places[i], places[j]) <= reach * reach and boxes_meet(
                rotations[i], places[i], halves[i], rotations[j], places[j], halves[j]):
            if found < out.shape[0]:
                out[found, 0], out[found, 1] = i, j
            found += 1
    turns, centres, sides, sizes, starts, balls = fixed
    for c in range(balls.shape[0]):
        for i in range(places.shape[0]):
            reach = radii[i] + balls[c, 3] + 1e-6
            if not active[i] or _square(places[i], balls[c]) > reach * reach:
                continue
            for k in range(starts[c], starts[c + 1]):
                reach = radii[i] + sizes[k] + 1e-6
                if _square(places[i], centres[k]) <= reach * reach and boxes_meet(
                        rotations[i], places[i], halves[i], turns[k], centres[k], sides[k]):
                    if found < out.shape[0]:
                        out[found, 0], out[found, 1] = i, -1 - k
                    found += 1
    return found


@compiled
def gaps(robot, movers, pairs, active, fixed, poses):
    """Return rows (o, 2) as :func:`near`, of all that is checked, and (o,) [m] below which none of their distances is.

    The distance of the centre of one from the other's box, less its ball's radius, and the other way round.
    """
    kinematics, q, base = robot
    rotations, places = place(kinematics, q, base, movers, poses)
    halves, radii = movers[3], movers[4]
    turns, centres, sides, sizes = fixed[0], fixed[1], fixed[2], fixed[3]
    count = pairs.shape[0] + active.sum() * centres.shape[0]
    rows, least = np.empty((count, 2), dtype=np.int64), np.empty(count)
    n = 0
    for p in range(pairs.shape[0]):
        i, j = pairs[p, 0], pairs[p, 1]
        rows[n, 0], rows[n, 1] = i, j
        least[n] = max(_to_box(places[i], rotations[j], places[j], halves[j]) - radii[i],
                       _to_box(places[j], rotations[i], places[i], halves[i]) - radii[j])
        n += 1
    for i in range(places.shape[0]):
        if active[i]:
            for k in range(centres.shape[0]):
                rows[n, 0], rows[n, 1] = i, -1 - k
                least[n] = max(_to_box(places[i], turns[k], centres[k], sides[k]) - radii[i],
                               _to_box(centres[k], rotations[i], places[i], halves[i]) - sizes[k])
                n += 1
    return rows, least


@compiled
def _square(a, b):
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return x * x + y * y + z * z


@compiled
def _to_box(point, rotation, centre, half):
    """Distance of a point from a box."""
    square = 0.0
    x, y, z = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    for a in range(3):
        beyond = abs(rotation[0, a] * x + rotation[1, a] * y + rotation[2, a] * z) - half[a]
        if beyond > 0.0:
            square += beyond * beyond
    return math.sqrt(square)


@compiled
def boxes_meet(turn_a, centre_a, half_a, turn_b, centre_b, half_b):
    """Whether two boxes overlap or are nearer than a micrometre: no one of 15 axes separates them (Gottschalk 1996).

    All in scalars: an array made here would take longer than the rest.
    """
    margin = 1e-6
    x, y, z = centre_b[0] - centre_a[0], centre_b[1] - centre_a[1], centre_b[2] - centre_a[2]
    t0, r00, r01, r02 = _along(turn_a, 0, x, y, z, turn_b)
    s00, s01, s02 = abs(r00) + 1e-9, abs(r01) + 1e-9, abs(r02) + 1e-9
    a0, a1, a2, b0, b1, b2 = half_a[0], half_a[1], half_a[2], half_b[0], half_b[1], half_b[2]
    if abs(t0) > a0 + b0 * s00 + b1 * s01 + b2 * s02 + margin:
        return False
    t1, r10, r11, r12 = _along(turn_a, 1, x, y, z, turn_b)
    s10, s11, s12 = abs(r10) + 1e-9, abs(r11) + 1e-9, abs(r12) + 1e-9
    if abs(t1) > a1 + b0 * s10 + b1 * s11 + b2 * s12 + margin:
        return False
    t2, r20, r21, r22 = _along(turn_a, 2, x, y, z, turn_b)
    s20, s21, s22 = abs(r20) + 1e-9, abs(r21) + 1e-9, abs(r22) + 1e-9
    if abs(t2) > a2 + b0 * s20 + b1 * s21 + b2 * s22 + margin:
        return False
    if (abs(t0 * r00 + t1 * r10 + t2 * r20) > b0 + a0 * s00 + a1 * s10 + a2 * s20 + margin
            or abs(t0 * r01 + t1 * r11 + t2 * r21) > b1 + a0 * s01 + a1 * s11 + a2 * s21 + margin
            or abs(t0 * r02 + t1 * r12 + t2 * r22) > b2 + a0 * s02 + a1 * s12 + a2 * s22 + margin):
        return False
    # The cross products of an axis of each.
    return not (abs(t2 * r10 - t1 * r20) > a1 * s20 + a2 * s10 + b1 * s02 + b2 * s01 + margin
                or abs(t2 * r11 - t1 * r21) > a1 * s21 + a2 * s11 + b2 * s00 + b0 * s02 + margin
                or abs(t2 * r12 - t1 * r22) > a1 * s22 + a2 * s12 + b0 * s01 + b1 * s00 + margin
                or abs(t0 * r20 - t2 * r00) > a2 * s00 + a0 * s20 + b1 * s12 + b2 * s11 + margin
                or abs(t0 * r21 - t2 * r01) > a2 * s01 + a0 * s21 + b2 * s10 + b0 * s12 + margin
                or abs(t0 * r22 - t2 * r02) > a2 * s02 + a0 * s22 + b0 * s11 + b1 * s10 + margin
                or abs(t1 * r00 - t0 * r10) > a0 * s10 + a1 * s00 + b1 * s22 + b2 * s21 + margin
                or abs(t1 * r01 - t0 * r11) > a0 * s11 + a1 * s01 + b2 * s20 + b0 * s22 + margin
                or abs(t1 * r02 - t0 * r12) > a0 * s12 + a1 * s02 + b0 * s21 + b1 * s20 + margin)


@compiled
def _along(turn_a, axis, x, y, z, turn_b):
    """What (x, y, z) and the three axes of b are along an axis of a."""
    u, v, w = turn_a[0, axis], turn_a[1, axis], turn_a[2, axis]
    return (u * x + v * y + w * z, u * turn_b[0, 0] + v * turn_b[1, 0] + w * turn_b[2, 0],
            u * turn_b[0, 1] + v * turn_b[1, 1] + w * turn_b[2, 1],
            u * turn_b[0, 2] + v * turn_b[1, 2] + w * turn_b[2, 2])
