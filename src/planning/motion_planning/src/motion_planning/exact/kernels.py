# SPDX-License-Identifier: BSD-3-Clause
"""Compiled proofs that shapes do not touch: balls of sixteen postures at once, then boxes, then planes between them.

Shapes that move with the robot ("movers", m) belong to links: links (m,) index, local (m, 4, 4) pose in the link,
centres (m, 3), halves (m, 3) and radii (m,) of their bounds, and the centres (m, 3) in the link. Fixed shapes (f)
have rotations (f, 3, 3), centres (f, 3), halves (f, 3), radii (f,) in the planning frame, sorted so that chunks of them
lie together: starts (c + 1,), balls (c, 4) centre and radius of each chunk. Both have forms, see ``apart``.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.exact import apart
from motion_planning.exact.apart import boxes_meet, compiled, pair_apart
from motion_planning.exact.sixteen import near_each_other, place_sixteen
from motion_planning.model.kernels import fill_frame

if TYPE_CHECKING:
    from motion_planning.exact.apart import Forms
    from motion_planning.model.kernels import Kinematics

    RobotAt = tuple[Kinematics, np.ndarray, np.ndarray]
    MoverArrays = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, Forms, np.ndarray]
    FixedArrays = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, Forms]
    Work = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@compiled
def _place_mover(i: int, movers: MoverArrays, work: Work) -> None:
    """Write the pose of mover ``i``, and the rotation and the place of its box. work: frames of the links, poses (m, 4,
    4), rotations (m, 3, 3), places (m, 3)."""
    of_links, local, centres = movers[0], movers[1], movers[2]
    frames, poses, rotations, places = work
    frame, inner, out = frames[of_links[i]], local[i], poses[i]
    for a in range(3):
        for b in range(4):
            value = frame[a, 0] * inner[0, b] + frame[a, 1] * inner[1, b] + frame[a, 2] * inner[2, b]
            out[a, b] = value + frame[a, 3] if b == 3 else value
        places[i, a] = out[a, 0] * centres[i, 0] + out[a, 1] * centres[i, 1] + out[a, 2] * centres[i, 2] + out[a, 3]
        for b in range(3):
            rotations[i, a, b] = out[a, b]
    out[3, 0], out[3, 1], out[3, 2], out[3, 3] = 0.0, 0.0, 0.0, 1.0


@compiled
def _work_arrays(kinematics: Kinematics, poses: np.ndarray) -> Work:
    count = poses.shape[0]
    return np.empty((kinematics[0].shape[0], 4, 4)), poses, np.empty((count, 3, 3)), np.empty((count, 3))


@compiled
def _place_all(robot: RobotAt, movers: MoverArrays, work: Work) -> None:
    kinematics, q, base = robot
    for link in range(kinematics[0].shape[0]):
        fill_frame(kinematics, link, q, base, work[0])
    for i in range(work[1].shape[0]):
        _place_mover(i, movers, work)


@compiled
def fill_poses(robot: RobotAt, movers: MoverArrays, poses: np.ndarray) -> None:
    """Fill ``poses`` (m, 4, 4) with those of all movers. robot: kinematics, q, base."""
    _place_all(robot, movers, _work_arrays(robot[0], poses))


@compiled
def _place_at(i: int, robot: RobotAt, movers: MoverArrays, work: Work,
              made: tuple[int, np.ndarray, np.ndarray]) -> None:
    """Place mover ``i`` and the links that lead to it, if that is not done. made: number of the posture, and those for
    which each link and each mover was placed last."""
    kinematics, q, base = robot
    parents = kinematics[0]
    number, of_links, of_movers = made
    if of_movers[i] == number:
        return
    link = movers[0][i]
    while of_links[link] != number:
        first = link
        while parents[first] >= 0 and of_links[parents[first]] != number:
            first = parents[first]
        fill_frame(kinematics, first, q, base, work[0])
        of_links[first] = number
    _place_mover(i, movers, work)
    of_movers[i] = number


@compiled
def unproven(robot: tuple[Kinematics, np.ndarray], postures: np.ndarray, movers: MoverArrays,
             checked: tuple[np.ndarray, np.ndarray], fixed: FixedArrays, out: np.ndarray) -> int:
    """Fill ``out`` (o, 3) with what may touch; return how many rows there are, which may be more than ``out`` has.

    robot: kinematics, base. postures (p, n). A row is the index of a posture and two movers, or a mover and -1 - the
    fixed shape, that are not proven to be apart; in the order of postures. checked: pairs (p, 2) of movers that are
    checked against each other; the indices of the movers that are checked against fixed shapes.
    """
    kinematics, base = robot
    count, links = movers[1].shape[0], kinematics[0].shape[0]
    work = _work_arrays(kinematics, np.empty((count, 4, 4)))
    rotations, places = work[2], work[3]
    halves, radii, forms = movers[3], movers[4], movers[5]
    turns, centres, sides, sizes, starts, balls, fixed_forms = fixed
    of_links, of_movers = np.full(links, -1), np.full(count, -1)
    frames, spots = np.empty(192 * links, np.float32), np.empty(48 * count, np.float32)
    stack = apart.stack()
    found = 0
    for begin in range(0, postures.shape[0], 16):
        some = postures[begin : begin + 16]
        margin = place_sixteen(kinematics, base[:3, :3], some, movers, frames, spots)
        near, size = near_each_other((frames, spots), movers, checked, fixed,
                                     (base[:3, 3], margin, (1 << len(some)) - 1))
        for lane in range(len(some)):
            at, made = (kinematics, some[lane], base), (begin + lane, of_links, of_movers)
            for row in range(size):
                if not near[row, 2] >> lane & 1:
                    continue
                i, j = near[row, 0], near[row, 1]
                _place_at(i, at, movers, work, made)
                if j >= 0:
                    _place_at(j, at, movers, work, made)
                    reach = radii[i] + radii[j] + 1e-6
                    is_apart = _square(places[i], places[j]) > reach * reach or not boxes_meet(
                        rotations[i], places[i], halves[i], rotations[j], places[j], halves[j]) or pair_apart(
                        forms, (i, rotations[i], places[i]), forms, (j, rotations[j], places[j]), stack)
                else:
                    k, reach = -1 - j, radii[i] + 1e-6
                    is_apart = _square_to_box(places[i], turns[k], centres[k], sides[k]) > reach * reach or \
                        not boxes_meet(rotations[i], places[i], halves[i], turns[k], centres[k], sides[k]) or \
                        pair_apart(forms, (i, rotations[i], places[i]), fixed_forms, (k, turns[k], centres[k]), stack)
                if not is_apart:
                    if found < out.shape[0]:
                        out[found, 0], out[found, 1], out[found, 2] = begin + lane, i, j
                    found += 1
    return found


@compiled
def gaps(robot: RobotAt, movers: MoverArrays, pairs: np.ndarray, active: np.ndarray, fixed: FixedArrays,
         poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (o, 2) of two movers, or a mover and -1 - the fixed shape, of all that is checked, and (o,) [m] below
    which none of their distances is.

    The distance of the centre of one from the other's box, less its ball's radius, and the other way round.
    """
    work = _work_arrays(robot[0], poses)
    _place_all(robot, movers, work)
    rotations, places = work[2], work[3]
    halves, radii = movers[3], movers[4]
    turns, centres, sides, sizes = fixed[0], fixed[1], fixed[2], fixed[3]
    count = pairs.shape[0] + active.shape[0] * centres.shape[0]
    rows, least = np.empty((count, 2), dtype=np.int64), np.empty(count)
    n = 0
    for p in range(pairs.shape[0]):
        i, j = pairs[p, 0], pairs[p, 1]
        rows[n, 0], rows[n, 1] = i, j
        least[n] = max(_to_box(places[i], rotations[j], places[j], halves[j]) - radii[i],
                       _to_box(places[j], rotations[i], places[i], halves[i]) - radii[j])
        n += 1
    for i in active:
        for k in range(centres.shape[0]):
            rows[n, 0], rows[n, 1] = i, -1 - k
            least[n] = max(_to_box(places[i], turns[k], centres[k], sides[k]) - radii[i],
                           _to_box(centres[k], rotations[i], places[i], halves[i]) - sizes[k])
            n += 1
    return rows, least


@compiled
def balls_of(centres: np.ndarray, radii: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return (c, 4), centre and radius of a ball around each chunk of balls with ``centres`` (f, 3) and ``radii`` (f,).
    starts (c + 1,): where the chunks begin, and where the last one ends."""
    balls = np.zeros((len(starts) - 1, 4))
    for chunk in range(len(balls)):
        begin, end = starts[chunk], starts[chunk + 1]
        for a in range(3):
            balls[chunk, a] = 0.5 * (centres[begin:end, a].min() + centres[begin:end, a].max())
        for k in range(begin, end):
            balls[chunk, 3] = max(balls[chunk, 3], math.sqrt(_square(centres[k], balls[chunk])) + radii[k])
    return balls


@compiled
def _square(a: np.ndarray, b: np.ndarray) -> float:
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return x * x + y * y + z * z


@compiled
def _to_box(point: np.ndarray, rotation: np.ndarray, centre: np.ndarray, half: np.ndarray) -> float:
    """Distance of a point from a box."""
    return math.sqrt(_square_to_box(point, rotation, centre, half))


@compiled
def _square_to_box(point: np.ndarray, rotation: np.ndarray, centre: np.ndarray, half: np.ndarray) -> float:
    square = 0.0
    x, y, z = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    for a in range(3):
        beyond = abs(rotation[0, a] * x + rotation[1, a] * y + rotation[2, a] * z) - half[a]
        if beyond > 0.0:
            square += beyond * beyond
    return square
