# SPDX-License-Identifier: BSD-3-Clause
"""Checks sixteen configurations at once: the positions of the robot's spheres, and their collisions with the world or
each other.

A checker is two tuples of flat arrays, made by ``tables``:

    robot = (joints, joint_numbers, clusters, cluster_numbers, spheres, pairs, tests, branches, skips, maps, cells)
    world = (node_links, nodes, kinds, objects)

``joints`` (3 int32 each): parent joint or -1, 1 if prismatic, variable; parents come first.
``joint_numbers`` (14 float32 each): rotation (3, 3) and offset of the joint's frame in its parent's, the axis being z;
multiplier and offset of the variable.
``clusters`` (3 int32): joint, first and last + 1 sphere. ``cluster_numbers`` (4 float32): a ball around all spheres of
the cluster, centre in the joint's frame and radius. ``spheres``: the same, a tree: ``skips`` (1 int32) is 0 for a
sphere, and for a ball around the following spheres the index of the first one outside of it. ``pairs`` (2 int32):
clusters that must not collide. ``tests`` (3 int32): cluster, first and last + 1 node that it must not hit; the most
frequent hits should come first. ``branches`` (6 int32): first and last + 1 joint, cluster and test of the branch below
one root joint. ``maps`` (3 int32): two variables that turn, and the first of their CELLS x CELLS ``cells`` (uint8); 1
where the robot may touch itself, see ``pair_maps``. ``nodes`` (6 float32): least and greatest corner.
``node_links`` (2 int32): the node to continue with if this one is not hit, the object or -1. ``kinds`` and ``objects``
(16 float32): SPHERE ... below; centre (3), rotation from the planning frame's axes into the object's (3, 3), sizes (3).
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.lanes import below, fill, greatest, load, magnitude, ramp, root, sine_and_cosine, store
from motion_planning.spheres.compiled import compiled

if TYPE_CHECKING:
    from motion_planning.lanes import Vector

    Table = tuple[np.ndarray, ...]
    World = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    Tables = tuple[Table, World]
    Work = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

SPHERE, AXIS_BOX, BOX, UPRIGHT_CYLINDER, CYLINDER, PLANE = range(6)
JOINT, JOINT_NUMBERS, CLUSTER, OBJECT, BRANCH, MAP = 3, 14, 3, 16, 6, 3
#: Cells of a map along a full turn, a power of two.
CELLS = 64
ALL = 0xFFFF

_ONE, _ZERO = np.float32(1.0), np.float32(0.0)
_CELLS_PER_RADIAN = np.float32(CELLS / (2.0 * np.pi))


@compiled
def place_joints(robot: Table, q: np.ndarray, begin: int, end: int, frames: np.ndarray) -> None:
    """Write the frames of the joints begin ... end - 1, 12 lanes each: columns x, y, z and the origin.

    q: 16 values of each variable.
    """
    joints, numbers = robot[0], robot[1]
    for j in range(begin, end):
        parent, prismatic, variable = joints[JOINT * j], joints[JOINT * j + 1], joints[JOINT * j + 2]
        n = JOINT_NUMBERS * j
        value = load(q, 16 * variable) * fill(numbers[n + 12]) + fill(numbers[n + 13])
        # Read before anything is written: the compiler does not know that these are other arrays.
        r0, r1, r2 = fill(numbers[n]), fill(numbers[n + 1]), fill(numbers[n + 2])
        r3, r4, r5 = fill(numbers[n + 3]), fill(numbers[n + 4]), fill(numbers[n + 5])
        r6, r7, r8 = fill(numbers[n + 6]), fill(numbers[n + 7]), fill(numbers[n + 8])
        p0, p1, p2 = fill(numbers[n + 9]), fill(numbers[n + 10]), fill(numbers[n + 11])
        if prismatic:
            s, c = fill(_ZERO), fill(_ONE)
            p0, p1, p2 = p0 + value * r2, p1 + value * r5, p2 + value * r8
        else:
            s, c = sine_and_cosine(value)
        # The joint's own motion turns x and y about z.
        r0, r1 = r0 * c + r1 * s, r1 * c - r0 * s
        r3, r4 = r3 * c + r4 * s, r4 * c - r3 * s
        r6, r7 = r6 * c + r7 * s, r7 * c - r6 * s
        at = 192 * j
        if parent < 0:
            _store_column(frames, at, r0, r3, r6)
            _store_column(frames, at + 48, r1, r4, r7)
            _store_column(frames, at + 96, r2, r5, r8)
            _store_column(frames, at + 144, p0, p1, p2)
            continue
        up = 192 * parent
        for axis in range(3):  # of the frame outside
            a, b, d = load(frames, up + 16 * axis), load(frames, up + 16 * axis + 48), load(frames, up + 16 * axis + 96)
            p = load(frames, up + 16 * axis + 144)
            place = at + 16 * axis
            store(frames, place, a * r0 + b * r3 + d * r6)
            store(frames, place + 48, a * r1 + b * r4 + d * r7)
            store(frames, place + 96, a * r2 + b * r5 + d * r8)
            store(frames, place + 144, p + a * p0 + b * p1 + d * p2)


@compiled
def _store_column(frames: np.ndarray, at: int, x: Vector, y: Vector, z: Vector) -> None:
    store(frames, at, x)
    store(frames, at + 16, y)
    store(frames, at + 32, z)


@compiled
def _place(frames: np.ndarray, joint: int, numbers: np.ndarray, i: int) -> tuple[Vector, Vector, Vector]:
    """The centre of ball i."""
    at = 192 * joint
    x, y, z = fill(numbers[4 * i]), fill(numbers[4 * i + 1]), fill(numbers[4 * i + 2])
    return (load(frames, at) * x + load(frames, at + 48) * y + load(frames, at + 96) * z + load(frames, at + 144),
            load(frames, at + 16) * x + load(frames, at + 64) * y + load(frames, at + 112) * z + load(frames, at + 160),
            load(frames, at + 32) * x + load(frames, at + 80) * y + load(frames, at + 128) * z + load(frames, at + 176))


@compiled
def _beyond(x: Vector, half: Vector) -> Vector:
    """The excess of |x| over half, or 0."""
    return greatest(magnitude(x) - half, fill(_ZERO))


@compiled
def _meets_node(nodes: np.ndarray, node: int, x: Vector, y: Vector, z: Vector, square: Vector) -> int:
    """Mask of the lanes whose ball with that squared radius meets the node's box."""
    n = 6 * node
    nothing = fill(_ZERO)
    dx = greatest(greatest(fill(nodes[n]) - x, x - fill(nodes[n + 3])), nothing)
    dy = greatest(greatest(fill(nodes[n + 1]) - y, y - fill(nodes[n + 4])), nothing)
    dz = greatest(greatest(fill(nodes[n + 2]) - z, z - fill(nodes[n + 5])), nothing)
    return below(dx * dx + dy * dy + dz * dz, square)


@compiled
def _meets_object(kind: int, objects: np.ndarray, n: int, x: Vector, y: Vector, z: Vector, radius: np.float32) -> int:
    """Mask of the lanes whose ball at x, y, z meets an object."""
    x, y, z = x - fill(objects[n]), y - fill(objects[n + 1]), z - fill(objects[n + 2])
    if kind == BOX or kind == CYLINDER or kind == PLANE:
        a = x * fill(objects[n + 3]) + y * fill(objects[n + 4]) + z * fill(objects[n + 5])
        b = x * fill(objects[n + 6]) + y * fill(objects[n + 7]) + z * fill(objects[n + 8])
        z = x * fill(objects[n + 9]) + y * fill(objects[n + 10]) + z * fill(objects[n + 11])
        x, y = a, b
    r = fill(radius)
    if kind == PLANE:
        return below(magnitude(z) - fill(objects[n + 14]), r)
    if kind == SPHERE:
        reach = r + fill(objects[n + 12])
        return below(x * x + y * y + z * z, reach * reach)
    dz = _beyond(z, fill(objects[n + 14]))
    if kind == AXIS_BOX or kind == BOX:
        dx, dy = _beyond(x, fill(objects[n + 12])), _beyond(y, fill(objects[n + 13]))
        return below(dx * dx + dy * dy + dz * dz, r * r)
    out = greatest(root(x * x + y * y) - fill(objects[n + 12]), fill(_ZERO))
    return below(out * out + dz * dz, r * r)


@compiled
def _cluster_meets_object(tables: Tables, c: int, k: int, frames: np.ndarray, found: int, every: bool) -> int:
    """``found`` with the lanes in which a sphere of cluster c meets object k."""
    robot, (_, _, kinds, objects) = tables
    kind, n = kinds[k], OBJECT * k
    clusters, spheres, skips = robot[2], robot[4], robot[8]
    joint, s, last = clusters[CLUSTER * c], clusters[CLUSTER * c + 1], clusters[CLUSTER * c + 2]
    while s < last:
        x, y, z = _place(frames, joint, spheres, s)
        near = _meets_object(kind, objects, n, x, y, z, spheres[4 * s + 3])
        if skips[s]:
            s = s + 1 if near | found != found else skips[s]
            continue
        s += 1
        found |= near
        if found != 0 and (not every or found == ALL):
            break
    return found


@compiled
def _clusters_meet(robot: Table, a: int, b: int, frames: np.ndarray, centres: np.ndarray, found: int,
                   every: bool) -> int:
    """``found`` with the lanes in which a sphere of cluster a meets one of cluster b."""
    clusters, balls, spheres, skips = robot[2], robot[3], robot[4], robot[8]
    joint, s, last = clusters[CLUSTER * a], clusters[CLUSTER * a + 1], clusters[CLUSTER * a + 2]
    other, first, end = clusters[CLUSTER * b], clusters[CLUSTER * b + 1], clusters[CLUSTER * b + 2]
    bx, by, bz = load(centres, 48 * b), load(centres, 48 * b + 16), load(centres, 48 * b + 32)
    while s < last:
        x, y, z = _place(frames, joint, spheres, s)
        radius = spheres[4 * s + 3]
        if _balls_meet(x - bx, y - by, z - bz, radius + balls[4 * b + 3]) | found == found:
            s = skips[s] if skips[s] else s + 1
            continue
        s += 1
        if skips[s - 1]:
            continue
        o = first
        while o < end:
            u, v, w = _place(frames, other, spheres, o)
            near = _balls_meet(x - u, y - v, z - w, radius + spheres[4 * o + 3])
            if skips[o]:
                o = o + 1 if near | found != found else skips[o]
                continue
            o += 1
            found |= near
            if found != 0 and (not every or found == ALL):
                return found
    return found


@compiled
def _balls_meet(x: Vector, y: Vector, z: Vector, reach: np.float32) -> int:
    """Mask of the lanes in which two balls x, y, z apart meet; reach: their radii together."""
    return below(x * x + y * y + z * z, fill(reach * reach))


@compiled
def _in_closed_cells(robot: Table, q: np.ndarray, found: int) -> int:
    """``found`` with the lanes in which two joints are in a closed cell of their map."""
    maps, cells = robot[9], robot[10]
    for m in range(0, len(maps), MAP):
        u, v, begin = 16 * maps[m], 16 * maps[m + 1], maps[m + 2]
        for lane in range(16):
            row = int(np.floor(q[u + lane] * _CELLS_PER_RADIAN)) & CELLS - 1
            column = int(np.floor(q[v + lane] * _CELLS_PER_RADIAN)) & CELLS - 1
            if cells[begin + CELLS * row + column]:
                found |= 1 << lane
    return found


@compiled
def hits(tables: Tables, work: Work, every: bool) -> int:
    """Return the mask of those of 16 configurations that are in collision.

    tables: (robot, world). work: ``work_arrays``, the configurations in the first of them, 16 values of each variable.
    ``every`` false: the caller only needs to know whether any is in collision; the mask may be incomplete.
    """
    robot, world = tables
    q, frames, centres, last_hit = work
    clusters, balls, pairs, tests, branches = robot[2], robot[3], robot[5], robot[6], robot[7]
    links, nodes, kinds, objects = world
    found = 0
    count = len(branches) // BRANCH
    for turn in range(count):
        # The arm that was hit last is likely to be hit again; then the others need not be computed.
        b = (turn + last_hit[0]) % count
        row = BRANCH * b
        place_joints(robot, q, branches[row], branches[row + 1], frames)
        for c in range(branches[row + 2], branches[row + 3]):
            x, y, z = _place(frames, clusters[CLUSTER * c], balls, c)
            store(centres, 48 * c, x)
            store(centres, 48 * c + 16, y)
            store(centres, 48 * c + 32, z)
        for t in range(branches[row + 4], branches[row + 5]):
            c, node, end = tests[3 * t], tests[3 * t + 1], tests[3 * t + 2]
            x, y, z = load(centres, 48 * c), load(centres, 48 * c + 16), load(centres, 48 * c + 32)
            radius = balls[4 * c + 3]
            square = fill(radius * radius)
            while node < end:
                if _meets_node(nodes, node, x, y, z, square) | found == found:
                    node = links[2 * node]
                    continue
                k = links[2 * node + 1]
                node += 1
                if k < 0 or _meets_object(kinds[k], objects, OBJECT * k, x, y, z, radius) | found == found:
                    continue
                found = _cluster_meets_object(tables, c, k, frames, found, every)
                if found != 0 and (not every or found == ALL):
                    last_hit[0] = b
                    return found
    if len(robot[9]):
        found = _in_closed_cells(robot, q, found)
        if found != 0 and (not every or found == ALL):
            return found
    for i in range(len(pairs) // 2):
        a, b = pairs[2 * i], pairs[2 * i + 1]
        x, y, z = load(centres, 48 * a), load(centres, 48 * a + 16), load(centres, 48 * a + 32)
        if _balls_meet(x - load(centres, 48 * b), y - load(centres, 48 * b + 16), z - load(centres, 48 * b + 32),
                       balls[4 * a + 3] + balls[4 * b + 3]) | found == found:
            continue
        found = _clusters_meet(robot, a, b, frames, centres, found, every)
        if found != 0 and (not every or found == ALL):
            return found
    return found


@compiled
def work_arrays(robot: Table) -> Work:
    """Return the arrays that ``hits`` works in: values, frames, centres of clusters, the branch to begin with."""
    variables = 1
    for j in range(len(robot[0]) // JOINT):
        variables = max(variables, robot[0][JOINT * j + 2] + 1)
    return (np.empty(16 * variables, np.float32), np.empty(192 * (len(robot[0]) // JOINT), np.float32),
            np.empty(12 * len(robot[3]), np.float32), np.zeros(1, np.int64))


@compiled
def free_states(tables: Tables, states: np.ndarray, free: np.ndarray) -> None:
    """Write for each row of ``states`` (m, k) float32 whether it is free of collisions."""
    work = work_arrays(tables[0])
    q = work[0]
    m, k = states.shape
    for begin in range(0, m, 16):
        for lane in range(16):
            row = min(begin + lane, m - 1)
            for j in range(k):
                q[16 * j + lane] = states[row, j]
        found = hits(tables, work, True)
        for lane in range(min(16, m - begin)):
            free[begin + lane] = found >> lane & 1 == 0


@compiled
def free_edge(tables: Tables, work: Work, a: np.ndarray, b: np.ndarray, step: float) -> bool:
    """Whether the straight line from ``a`` to ``b`` (k,) float32 is free, checked in steps of at most ``step``. ``a``
    itself is left out. There are at least sixteen steps, so that no lane is idle. They are checked from coarse to fine,
    the end first.
    """
    q = work[0]
    length = np.float32(0.0)
    for j in range(len(a)):
        length += (b[j] - a[j]) * (b[j] - a[j])
    rows = max(1, int(np.ceil(np.sqrt(length) / (np.float32(16.0) * step))))
    count = np.float32(16 * rows)
    bits = 1
    while bits < rows:
        bits *= 2
    for turn in range(bits):
        # The bits of the turn in reverse: 0, 1/2, 1/4, 3/4 ... of the distance between two lanes.
        back, one, rest = 0, bits >> 1, turn
        while rest:
            if rest & 1:
                back += one
            one >>= 1
            rest >>= 1
        if back >= rows:
            continue
        along = (ramp() * fill(np.float32(rows)) + fill(np.float32(rows - back))) / fill(count)
        for j in range(len(a)):
            store(q, 16 * j, fill(a[j]) + along * fill(b[j] - a[j]))
        if hits(tables, work, False):
            return False
    return True


@compiled
def free_edges(tables: Tables, points: np.ndarray, step: float, free: np.ndarray) -> None:
    """Write into ``free`` (m - 1,) whether each line between ``points`` (m, k) float32 is, see ``free_edge``; those
    that are true already are not checked."""
    work = work_arrays(tables[0])
    for i in range(len(free)):
        if not free[i]:
            free[i] = free_edge(tables, work, points[i], points[i + 1], step)


@compiled
def free_way(tables: Tables, points: np.ndarray, step: float) -> bool:
    """Whether all lines between ``points`` (m, k) float32 are free, see ``free_edge``."""
    work = work_arrays(tables[0])
    for i in range(len(points) - 1):
        if not free_edge(tables, work, points[i], points[i + 1], step):
            return False
    return True
