# SPDX-License-Identifier: BSD-3-Clause
"""Where an arm is near to something: gaps between spheres and what they must not touch, with their directions.

Reads the tables that ``motion_planning.spheres`` makes of a scene; their layout is described in its ``kernel``. The
planner asks them whether anything touches; here, the distance matters, and which joints change it.
"""
import math

import numpy as np

from motion_planning.spheres import kernel
from moveit_servo.compiled import compiled

_JOINT, _NUMBERS, _CLUSTER, _OBJECT, _BRANCH = (kernel.JOINT, kernel.JOINT_NUMBERS, kernel.CLUSTER, kernel.OBJECT,
                                                kernel.BRANCH)
_SPHERE, _AXIS_BOX, _BOX, _PLANE = kernel.SPHERE, kernel.AXIS_BOX, kernel.BOX, kernel.PLANE
_MAP, _CELLS = kernel.MAP, kernel.CELLS
#: Columns of a gap: distance [m], normal (3) from the other body towards this one, point (3) [m], number of the joint
#: that this body moves with, of the other's or -1, and of the cluster.
COLUMNS = 10
#: Gaps that are kept of one cluster of spheres. Two of them differ in their normals or are this far apart [m].
MAX_OF_CLUSTER, _APART_M, _SAME_DIRECTION = 6, 0.08, 0.9
# Of one pair of bodies, gaps count that are larger than the smallest one by at most this [m].
_SIMILAR_M = 0.03
# Objects beside the nearest one count up to this much farther away [m]: before others the arm can brake later.
_BESIDE_M = 0.05
# The same for one sphere: bodies side by side have some 100,000 pairs of spheres that are near.
_OF_ONE_BALL_M = 0.005


@compiled
def place(robot, q, frames):
    """Write the frames of the joints into ``frames`` (j, 3, 4) for ``q`` (n,): columns x, y, z and the origin."""
    joints, numbers = robot[0], robot[1]
    for j in range(len(joints) // _JOINT):
        parent, prismatic, variable = joints[_JOINT * j], joints[_JOINT * j + 1], joints[_JOINT * j + 2]
        n = _NUMBERS * j
        value = q[variable] * numbers[n + 12] + numbers[n + 13]
        s, c = (0.0, 1.0) if prismatic else (math.sin(value), math.cos(value))
        out = frames[j]
        for a in range(3):
            x, y, z = float(numbers[n + 3 * a]), float(numbers[n + 3 * a + 1]), float(numbers[n + 3 * a + 2])
            out[a, 0], out[a, 1], out[a, 2] = x * c + y * s, y * c - x * s, z
            out[a, 3] = numbers[n + 9 + a] + (value * z if prismatic else 0.0)
        if parent < 0:
            continue
        up = frames[parent]
        for column in range(4):
            x, y, z = out[0, column], out[1, column], out[2, column]
            for a in range(3):
                out[a, column] = up[a, 0] * x + up[a, 1] * y + up[a, 2] * z + (up[a, 3] if column == 3 else 0.0)


@compiled
def _place_balls(frame, numbers, begin, end, centres):
    """Write the centres of the balls ``begin`` ... ``end`` - 1 into ``centres`` (n, 3)."""
    for i in range(begin, end):
        x, y, z = numbers[4 * i], numbers[4 * i + 1], numbers[4 * i + 2]
        for a in range(3):
            centres[i, a] = frame[a, 0] * x + frame[a, 1] * y + frame[a, 2] * z + frame[a, 3]


@compiled
def _place_cluster(robot, frames, c, placed, spheres):
    """Write the centres of a cluster's spheres into ``spheres`` (s, 3), unless ``placed`` (c,) says that they are."""
    if not placed[c]:
        clusters = robot[2]
        _place_balls(frames[clusters[_CLUSTER * c]], robot[4], clusters[_CLUSTER * c + 1], clusters[_CLUSTER * c + 2],
                     spheres)
        placed[c] = True


@compiled
def _from_box(x, y, z, half):
    """(distance, normal (3,)) of a point to a box about the origin, of half its sizes: less than 0 inside; the normal
    leads away from it."""
    beyond_x, beyond_y, beyond_z = abs(x) - half[0], abs(y) - half[1], abs(z) - half[2]
    u, v, w = max(beyond_x, 0.0), max(beyond_y, 0.0), max(beyond_z, 0.0)
    distance = math.sqrt(u * u + v * v + w * w)
    if distance > 1e-9:
        u, v, w = u / distance, v / distance, w / distance
    elif beyond_x >= beyond_y and beyond_x >= beyond_z:
        distance, u, v, w = beyond_x, 1.0, 0.0, 0.0
    elif beyond_y >= beyond_z:
        distance, u, v, w = beyond_y, 0.0, 1.0, 0.0
    else:
        distance, u, v, w = beyond_z, 0.0, 0.0, 1.0
    return distance, (math.copysign(u, x), math.copysign(v, y), math.copysign(w, z))


@compiled
def _from_cylinder(x, y, z, half):
    """As ``_from_box``, for an upright cylinder; half: radius, radius, half of its height."""
    across = math.sqrt(x * x + y * y)
    x, y = (x / across, y / across) if across > 1e-9 else (1.0, 0.0)
    side, end = across - half[0], abs(z) - half[2]
    u, v = max(side, 0.0), max(end, 0.0)
    distance = math.sqrt(u * u + v * v)
    if distance < 1e-9:
        distance = max(side, end)
        u, v = (1.0, 0.0) if side > end else (0.0, 1.0)
    else:
        u, v = u / distance, v / distance
    return distance, (u * x, u * y, math.copysign(v, z))


@compiled
def object_distance(kind, objects, n, centre):
    """(distance, normal (3,)) of ``centre``, a sequence of x, y, z ..., to the surface of an object: less than 0 inside
    of it [m]; the normal leads away from the object. Without arrays, whose making takes longer than all else here."""
    dx, dy, dz = centre[0] - objects[n], centre[1] - objects[n + 1], centre[2] - objects[n + 2]
    half = (float(objects[n + 12]), float(objects[n + 13]), float(objects[n + 14]))
    if kind == _SPHERE:
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length > 1e-9:
            return length - half[0], (dx / length, dy / length, dz / length)
        return length - half[0], (0.0, 0.0, 1.0)
    if kind == _AXIS_BOX:
        return _from_box(dx, dy, dz, half)
    if kind == kernel.UPRIGHT_CYLINDER:
        return _from_cylinder(dx, dy, dz, half)
    r = n + 3
    x = objects[r] * dx + objects[r + 1] * dy + objects[r + 2] * dz
    y = objects[r + 3] * dx + objects[r + 4] * dy + objects[r + 5] * dz
    z = objects[r + 6] * dx + objects[r + 7] * dy + objects[r + 8] * dz
    if kind == _PLANE:
        distance, (u, v, w) = abs(z) - half[2], (0.0, 0.0, math.copysign(1.0, z))
    elif kind == _BOX:
        distance, (u, v, w) = _from_box(x, y, z, half)
    else:
        distance, (u, v, w) = _from_cylinder(x, y, z, half)
    return distance, (objects[r] * u + objects[r + 3] * v + objects[r + 6] * w,
                      objects[r + 1] * u + objects[r + 4] * v + objects[r + 7] * w,
                      objects[r + 2] * u + objects[r + 5] * v + objects[r + 8] * w)


@compiled
def _keep(rows, counts, c, new):
    """Put the gap ``new`` (COLUMNS,) among those of cluster ``c``, in the place of a similar or a larger one."""
    kept = rows[c]
    worst = -1
    for k in range(counts[c]):
        along = kept[k, 1] * new[1] + kept[k, 2] * new[2] + kept[k, 3] * new[3]
        if along > _SAME_DIRECTION and abs(kept[k, 4] - new[4]) + abs(kept[k, 5] - new[5]) + abs(
                kept[k, 6] - new[6]) < _APART_M and kept[k, 8] == new[8]:
            if new[0] < kept[k, 0]:
                kept[k] = new
            return
        if worst < 0 or kept[k, 0] > kept[worst, 0]:
            worst = k
    if counts[c] < MAX_OF_CLUSTER:
        kept[counts[c]] = new
        counts[c] += 1
    elif new[0] < kept[worst, 0]:
        kept[worst] = new


@compiled
def _fill(new, distance, normal, centre, radius):
    new[0] = distance - radius
    for a in range(3):
        new[1 + a] = normal[a]
        new[4 + a] = centre[a] - radius * normal[a]


@compiled
def _nearest_object(world, node, end, ball, reach, any_will_do):
    """(distance, normal (3,)) of a ``ball``, (x, y, z, radius), from the nearest object of the nodes ``node`` ...
    ``end`` - 1, or ``reach`` [m] if all are farther. any_will_do: the first within reach will."""
    links, nodes, kinds, objects = world
    x, y, z, radius = ball
    normal = (0.0, 0.0, 1.0)
    while node < end:
        n = 6 * node
        u = max(nodes[n] - x, x - nodes[n + 3], 0.0)
        v = max(nodes[n + 1] - y, y - nodes[n + 4], 0.0)
        w = max(nodes[n + 2] - z, z - nodes[n + 5], 0.0)
        far = reach + radius
        if far <= 0.0 or u * u + v * v + w * w > far * far:
            node = links[2 * node]
            continue
        k = links[2 * node + 1]
        node += 1
        if k >= 0:
            distance, direction = object_distance(kinds[k], objects, _OBJECT * k, ball)
            if distance - radius < reach:
                reach, normal = distance - radius, direction
                if any_will_do:
                    break
    return reach, normal


@compiled
def _object_gaps(tables, test, reach, places, found):
    """Keep the gaps of a ``test`` (3,): cluster, first and last + 1 node of the objects; of each sphere the smallest.
    places (s, 3): of the cluster's spheres."""
    robot, world = tables
    rows, counts = found
    clusters, spheres, skips = robot[2], robot[4], robot[8]
    c = test[0]
    joint, s, last = clusters[_CLUSTER * c], clusters[_CLUSTER * c + 1], clusters[_CLUSTER * c + 2]
    new = np.empty(COLUMNS)
    new[7], new[8], new[9] = joint, -1.0, c
    while s < last:
        radius = float(spheres[4 * s + 3])
        ball = (places[s, 0], places[s, 1], places[s, 2], radius)
        distance, normal = _nearest_object(world, test[1], test[2], ball, reach, skips[s] > 0)
        if distance >= reach:
            s = skips[s] if skips[s] else s + 1
            continue
        if not skips[s]:
            _fill(new, distance + radius, normal, places[s], radius)
            _keep(rows, counts, c, new)
            reach = min(reach, max(distance, 0.0) + _BESIDE_M)
        s += 1


@compiled
def _pair_gaps(robot, a, b, reach, places, found):
    """Keep the gaps of clusters ``a`` and ``b``; places (s, 3): of both clusters' spheres."""
    rows, counts = found
    clusters, spheres, skips = robot[2], robot[4], robot[8]
    joint, s, last = clusters[_CLUSTER * a], clusters[_CLUSTER * a + 1], clusters[_CLUSTER * a + 2]
    other, first, end = clusters[_CLUSTER * b], clusters[_CLUSTER * b + 1], clusters[_CLUSTER * b + 2]
    normal, new = np.empty(3), np.empty(COLUMNS)
    new[7], new[8], new[9] = joint, other, a
    while s < last:
        radius, o, is_near, reach_of_ball = spheres[4 * s + 3], first, False, reach
        while o < end:
            far = reach_of_ball + radius + spheres[4 * o + 3]
            x, y, z = places[s, 0] - places[o, 0], places[s, 1] - places[o, 1], places[s, 2] - places[o, 2]
            if far <= 0.0 or x * x + y * y + z * z > far * far:
                o = skips[o] if skips[o] else o + 1
                continue
            if skips[s] and not skips[o]:
                is_near = True
                break
            if not skips[o]:
                distance = _length(places[s], places[o], normal) - spheres[4 * o + 3]
                _fill(new, distance, normal, places[s], radius)
                _keep(rows, counts, a, new)
                reach = min(reach, distance - radius + _SIMILAR_M)
                reach_of_ball = min(reach, reach_of_ball, distance - radius + _OF_ONE_BALL_M)
            o += 1
        s = skips[s] if skips[s] and not is_near else s + 1


@compiled
def _length(p, origin, normal):
    """Distance of two points; writes the direction (3,) from ``origin`` to ``p``."""
    square = 0.0
    for a in range(3):
        normal[a] = p[a] - origin[a]
        square += normal[a] * normal[a]
    length = math.sqrt(square)
    for a in range(3):
        normal[a] = normal[a] / length if length > 1e-9 else (1.0 if a == 2 else 0.0)
    return length


@compiled
def near(tables, checks, reach, frames, rows):
    """Write the gaps smaller than ``reach`` [m] into ``rows`` (m, COLUMNS), of each cluster and of all the smallest, in
    their order; return their number.

    tables: (robot, world). checks: (pairs (p, 2) of clusters, tests (t, 3): cluster, first and last + 1 node), those of
    the tables that matter. frames (j, 3, 4): of the joints, as ``place`` writes them.
    """
    robot, world = tables
    clusters, balls = robot[2], robot[3]
    pairs, tests = checks
    count = len(clusters) // _CLUSTER
    found, counts = np.empty((count, MAX_OF_CLUSTER, COLUMNS)), np.zeros(count, np.int64)
    kept = (found, counts)
    centres, direction = np.empty((count, 3)), np.empty(3)
    placed, places = np.zeros(count, np.bool_), np.empty((len(robot[4]) // 4, 3))
    for c in range(count):
        _place_balls(frames[clusters[_CLUSTER * c]], balls, c, c + 1, centres)
    for t in range(len(tests)):
        c = tests[t, 0]
        ball = (centres[c, 0], centres[c, 1], centres[c, 2], float(balls[4 * c + 3]))
        if _nearest_object(world, tests[t, 1], tests[t, 2], ball, reach, True)[0] < reach:
            _place_cluster(robot, frames, c, placed, places)
            _object_gaps(tables, tests[t], reach, places, kept)
    for p in range(len(pairs)):
        a, b = pairs[p, 0], pairs[p, 1]
        if _length(centres[a], centres[b], direction) < balls[4 * a + 3] + balls[4 * b + 3] + reach:
            _place_cluster(robot, frames, a, placed, places)
            _place_cluster(robot, frames, b, placed, places)
            _pair_gaps(robot, a, b, reach, places, kept)
    where = np.empty((counts.sum(), 2), np.int64)
    distances, total = np.empty(len(where)), 0
    for c in range(count):
        for k in range(counts[c]):
            where[total, 0], where[total, 1], distances[total] = c, k, found[c, k, 0]
            total += 1
    total = min(total, len(rows))
    order = np.argsort(distances)
    for n in range(total):
        rows[n] = found[where[order[n], 0], where[order[n], 1]]
    return total


@compiled
def slopes(robot, frames, rows, count, out):
    """Write into ``out`` (m, n) by how much each variable changes the first ``count`` gaps of ``rows`` [m per rad]."""
    joints, numbers = robot[0], robot[1]
    for k in range(count):
        out[k, :] = 0.0
        for side in range(2):
            joint = int(rows[k, 7 + side])
            sign = 1.0 - 2.0 * side
            while joint >= 0:
                frame = frames[joint]
                variable = joints[_JOINT * joint + 2]
                zx, zy, zz = frame[0, 2], frame[1, 2], frame[2, 2]
                if joints[_JOINT * joint + 1]:
                    x, y, z = zx, zy, zz
                else:
                    px, py, pz = rows[k, 4] - frame[0, 3], rows[k, 5] - frame[1, 3], rows[k, 6] - frame[2, 3]
                    x, y, z = zy * pz - zz * py, zz * px - zx * pz, zx * py - zy * px
                out[k, variable] += sign * numbers[_NUMBERS * joint + 12] * (
                    rows[k, 1] * x + rows[k, 2] * y + rows[k, 3] * z)
                joint = joints[_JOINT * joint]


@compiled
def closed_cell(robot, q):
    """Whether two joints are in a closed cell of their map: links that spheres cannot tell apart may touch."""
    maps, cells = robot[9], robot[10]
    for m in range(0, len(maps), _MAP):
        row = int(math.floor(q[maps[m]] * _CELLS / (2.0 * math.pi))) & _CELLS - 1
        column = int(math.floor(q[maps[m + 1]] * _CELLS / (2.0 * math.pi))) & _CELLS - 1
        if cells[maps[m + 2] + _CELLS * row + column]:
            return True
    return False


@compiled
def around(tables, checks, q, velocity, own, reach, most):
    """Return what is nearer than ``reach`` [m] to the arm of the variables ``own`` (k,) at ``q`` (n,), the ``most``
    nearest gaps: distance (m,), slope (m, k), drift (m,), of_robot (m,) and closed as in ``surroundings.Near``.

    velocity (n,): of all joints; tables, checks: see ``near``.
    """
    robot = tables[0]
    frames, rows = np.empty((len(robot[0]) // _JOINT, 3, 4)), np.empty((most, COLUMNS))
    place(robot, q, frames)
    count = near(tables, checks, reach, frames, rows)
    every, others = np.empty((count, len(q))), velocity.copy()
    slopes(robot, frames, rows, count, every)
    others[own] = 0.0
    distance, slope, drift = np.empty(count), np.empty((count, len(own))), np.zeros(count)
    of_robot = np.empty(count, np.bool_)
    for k in range(count):
        distance[k], of_robot[k] = rows[k, 0], rows[k, 8] >= 0.0
        for a in range(len(own)):
            slope[k, a] = every[k, own[a]]
        for a in range(len(q)):
            drift[k] += every[k, a] * others[a]
    return distance, slope, drift, of_robot, closed_cell(robot, q)
