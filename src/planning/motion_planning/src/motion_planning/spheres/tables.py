# SPDX-License-Identifier: BSD-3-Clause
"""A scene for one group, as flat arrays for ``kernel``.

Bodies that move with the group become spheres on joints; all others, including other links of the robot, become the
world. The robot's part does not depend on the scene and is cached in the SphereModel.
"""
from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from motion_planning.shapes import Cone, Octree
from motion_planning.spheres import kernel
from motion_planning.spheres.cover import ball
from motion_planning.spheres.pair_maps import pair_map
from motion_planning.spheres.sphere_model import Kept, Patience, object_spheres
from motion_planning.spheres.world_tables import BoxTree, forest, pyramid, solids_of, tree_of
from urdf_model import Box, Cylinder, Plane

if TYPE_CHECKING:
    from motion_planning.model import Group, PlanningModel, State
    from motion_planning.scene import AllowedCollisions, Scene, WorldObject
    from motion_planning.shapes import Geometry, Placed
    from motion_planning.spheres import SphereModel
    from motion_planning.spheres.kernel import Table, Tables
    from motion_planning.spheres.sphere_model import Boxes
    from motion_planning.spheres.world_tables import Forest

    _Joint = tuple[int, int, int, list[float]]

# Clusters on the same joint become one if the ball around both is at most this much larger than the larger one's.
_MERGED = 1.25
# Number of spheres that are checked one by one.
_FEW_SPHERES = 4
# Levels of halving that give a held object's greatest number of spheres, 4096: the robot has some hundred.
_MAX_HALVINGS = 12
_ENDLESS = Patience()
# Number of robots with a group that are split at a time.
_splits = Kept(16)
T = TypeVar("T")


class _Mover(NamedTuple):
    """A link or an attached object: spheres (n, 4) in the frame of the joint that it moves with."""

    name: str
    touch: frozenset[str]
    joint: int
    spheres: np.ndarray


class _Cluster(NamedTuple):
    """Movers on one joint that may touch the same bodies."""

    joint: int
    movers: tuple[_Mover, ...]
    spheres: np.ndarray
    ball: np.ndarray


class _Still(NamedTuple):
    """A link or an attached object that the group does not move; may: for each cluster, whether they may touch."""

    tree: BoxTree
    may: tuple[bool, ...]


class _Robot(NamedTuple):
    """The robot's part of the tables for a group, independent of objects."""

    clusters: tuple[_Cluster, ...]
    branch: tuple[int, ...]  # of each cluster
    depth: tuple[int, ...]
    # Of the kernel's robot table, without tests and the rest.
    arrays: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[int, ...]]
    pairs: np.ndarray
    still: tuple[_Still, ...]
    maps: tuple[np.ndarray, np.ndarray]  # (maps, cells) of the kernel's robot table
    world: Forest  # the table of ``still``, and their places in it


def bake(sphere_model: SphereModel, group: Group, scene: Scene, state: State,
         patience: Patience = _ENDLESS) -> tuple[Tables, tuple[str, ...]]:
    """Return ((robot, world), see ``kernel``, sentences on what is coarser than usual): what of ``scene`` the joints of
    ``group`` can run into, elsewhere as in ``state``. Scenes that differ in the values of these joints alone have the
    same tables, made once, unless patience ended: the next request makes them better.
    """
    others = np.delete(state.q, group.indices)
    key = (group.name, id(scene.allowed), others.tobytes(), state.base.tobytes(), tuple(scene.link_padding.items()),
           tuple(scene.link_scale.items()), tuple(map(id, state.attached.values())))
    # What a key names by identity is kept with what is found: no other object gets the same.
    named = scene.allowed, scene.objects, scene.octomap, tuple(state.attached.values())
    whole = *key, id(scene.objects), id(scene.octomap)
    made, _ = sphere_model.scenes(whole, lambda: (_baked(sphere_model, group, scene, state, (key, patience)), named))
    if patience.late():
        sphere_model.scenes.forget(whole)
    return made


def make_links(sphere_model: SphereModel, group: Group, allowed: AllowedCollisions) -> None:
    """Make what of a robot does not depend on the scene, which may take long the first time."""
    moving = frozenset(group.moving_links)
    for link in sphere_model.model.links:
        (sphere_model.spheres if link in moving else sphere_model.fixed)(link)
    _maps(sphere_model, group, allowed, [link for link in sphere_model.model.links if link in moving])


def _baked(sphere_model: SphereModel, group: Group, scene: Scene, state: State,
           how: tuple[tuple[Hashable, ...], Patience]) -> tuple[Tables, tuple[str, ...]]:
    key, patience = how
    things = [*scene.objects.values(), *([scene.octomap] if scene.octomap is not None else [])]
    movers = _mover_names(sphere_model.model, group, state)
    # For each object the bodies that may touch it, mostly none.
    named, _ = sphere_model.kept(("named", id(scene.allowed)), lambda: (_named(scene.allowed), scene.allowed))
    touchers = [mover for mover in movers if mover[1]]
    anything = [name for name, _ in movers if scene.allowed.defaults.get(name)]
    special = [(thing.id, frozenset(
        [name for name, touch in touchers if thing.id in touch]
        + (anything if thing.id not in named else [name for name, _ in movers if scene.allowed.allowed(name, thing.id)])
    )) for thing in things]
    special = {name: may for name, may in special if may}
    of_robot = *key, tuple(special.values())
    (robot, remarks), _ = sphere_model.kept(of_robot, lambda: (_robot(sphere_model, group, scene, state,
                                                                      (special, patience)),
                                                               (scene.allowed, *state.attached.values())))
    if patience.late():
        sphere_model.kept.forget(of_robot)
    groups, coarse = {}, {}
    for thing in things:
        may = special.get(thing.id, frozenset())
        allowed = tuple(all(mover.name in may for mover in cluster.movers) for cluster in robot.clusters) if may \
            else (False,) * len(robot.clusters)
        parts, owners = groups.setdefault(allowed, ([], []))
        parts += [(shape, thing.pose @ pose) for shape, pose in thing.shapes]
        owners += [thing.id] * len(thing.shapes)

    def remark(owners: Sequence[str], number: int, how: str) -> None:
        coarse["object '%s' is planned around as %s" % (owners[number], how)] = True

    stills = [_Still(tree_of(solids_of(parts, 0.0, patience, partial(remark, owners))), may)
              for may, (parts, owners) in groups.items()]
    remarks = [*remarks, *coarse]
    world, places = forest([still.tree for still in stills], robot.world)
    stills, places = [*stills, *robot.still], [*places[len(robot.still):], *places[: len(robot.still)]]
    # The tests do not depend on where things are.
    rows = tuple([still.may if place[1] > place[0] else None for still, place in zip(stills, places, strict=True)])
    tests, _ = sphere_model.kept(("tests", id(robot), rows), lambda: (_tests(robot, rows), robot))
    return (_with_tests(robot, tests, places), world), tuple(remarks)


def _named(allowed: AllowedCollisions) -> frozenset[str]:
    """The names that an AllowedCollisions says something about."""
    return frozenset(allowed.defaults).union(*allowed.entries)


def _tests(robot: _Robot, rows: Sequence[tuple[bool, ...] | None]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (clusters (t,), what each is tested against (t,), the kernel's branches): objects before the robot itself.
    rows: for each thing that does not move, for each cluster whether they may touch; None for nothing."""
    branch, depth = np.array(robot.branch, dtype=np.int64), np.array(robot.depth, dtype=np.int64)
    rank, cluster = np.array([(number, place) for number, may in enumerate(rows) if may is not None
                              for place, one in enumerate(may) if not one], np.int64).reshape(-1, 2).T
    order = np.lexsort((cluster, -depth[cluster], rank, branch[cluster]))
    joint_branch, cluster = robot.arrays[-1], cluster[order]
    numbers = np.arange(max(joint_branch, default=-1) + 1)
    ends = [end for keys in (joint_branch, branch, branch[cluster])
            for end in (np.searchsorted(keys, numbers), np.searchsorted(keys, numbers, "right"))]
    return cluster, rank[order], np.column_stack(ends).astype(np.int32).ravel()


def _with_tests(robot: _Robot, tests: tuple[np.ndarray, np.ndarray, np.ndarray],
                places: Sequence[tuple[int, int]]) -> Table:
    """The complete robot table with ``_tests`` of things at ``places`` in the world's."""
    cluster, rank, branches = tests
    rows = np.column_stack([cluster, np.array(places, np.int32).reshape(-1, 2)[rank]]).astype(np.int32)
    joints, *rest, skips, _ = robot.arrays
    return (joints, *rest, robot.pairs, rows.ravel(), branches, skips, *robot.maps)


def split(tables: Tables) -> list[tuple[np.ndarray, Tables]]:
    """Return [(indices of variables, tables of these alone)] of the branches of a robot, see ``kernel``.

    Empty unless there are at least two, each with its own variables, that together have all of them.
    """
    robot, world = tables
    return [(indices, ((joints, *robot[1:5], pairs, robot[6], np.ascontiguousarray(row), robot[8], maps, robot[10]),
                       world))
            for (indices, joints, pairs, maps), row in zip(_of_robot(robot).parts,
                                                           robot[7].reshape(-1, kernel.BRANCH), strict=False)]


def between(tables: Tables) -> Tables:
    """Return tables of the same robot that know collisions of its branches with each other only."""
    robot, world = tables
    rows = robot[7].reshape(-1, kernel.BRANCH).copy()
    rows[:, 4:] = 0  # no tests
    return (*robot[:5], _of_robot(robot).between, robot[6][:0], rows.ravel(), robot[8], robot[9][:0],
            robot[10][:0]), world


class _Split(NamedTuple):
    """The tables of ``split`` and ``between`` for a robot. parts: [(indices, joints, pairs, maps)]; between: the pairs
    of clusters of different branches; table: the robot's, whose identity is the key."""

    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
    between: np.ndarray
    table: Table


def _of_robot(robot: Table) -> _Split:
    """The _Split of a robot table."""
    key = tuple(map(id, (robot[0], robot[5], robot[9])))
    return _splits(key, lambda: _Split(_parts(robot), _between(robot), robot))


def _parts(robot: Table) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    joints, pairs, rows = robot[0].reshape(-1, kernel.JOINT), robot[5].reshape(-1, 2), robot[7].reshape(
        -1, kernel.BRANCH)
    if len(rows) < 2:
        return []
    owned = [np.unique(joints[first:last, 2]) for first, last, *_ in rows]
    if len(np.concatenate(owned)) != len(np.unique(joints[:, 2])):
        return []
    found = []
    for row, indices in zip(rows, owned, strict=True):
        alone = joints.copy()
        # Only the branch's own joints are placed.
        alone[row[0] : row[1], 2] = np.searchsorted(indices, alone[row[0] : row[1], 2])
        alone[: row[0], 2] = alone[row[1] :, 2] = 0
        inside = ((pairs >= row[2]) & (pairs < row[3])).all(axis=1)
        maps = robot[9].reshape(-1, kernel.MAP)
        maps = maps[np.isin(maps[:, :2], indices).all(axis=1)]
        maps[:, :2] = np.searchsorted(indices, maps[:, :2])
        found.append((indices, alone.ravel(), pairs[inside].ravel(), maps.ravel()))
    return found


def _between(robot: Table) -> np.ndarray:
    branch = np.searchsorted(robot[7].reshape(-1, kernel.BRANCH)[:, 3], robot[5], side="right").reshape(-1, 2)
    return robot[5].reshape(-1, 2)[branch[:, 0] != branch[:, 1]].ravel()


# -- the robot ----------------------------------------------------------------------------------------------------

def _mover_names(model: PlanningModel, group: Group, state: State) -> list[tuple[str, frozenset[str]]]:
    """[(name, names of bodies that it may always touch)] of the links that the group moves and their attached
    objects."""
    moving = frozenset(group.moving_links)
    return ([(name, frozenset()) for name in model.links if name in moving]
            + [(name, body.touch_links) for name, body in state.attached.items() if body.link in moving])


def _robot(sphere_model: SphereModel, group: Group, scene: Scene, state: State,
           about: tuple[Mapping[str, frozenset[str]], Patience]) -> tuple[_Robot, tuple[str, ...]]:
    """Return (the _Robot, sentences on what is coarser than usual). about: ({object: bodies that may touch it},
    Patience)."""
    model, (special, patience), remarks = sphere_model.model, about, []
    joints, carriers = _joints(model, group, state)
    movers, still = [], []
    frames = model.frames(state.q, state.base)
    for link, name in enumerate(model.links):
        joint, pose = carriers[link]
        if joint >= 0:
            spheres = sphere_model.spheres(name)
            if len(spheres):
                movers.append(_Mover(name, frozenset(), joint, _moved(spheres, pose, _padding(
                    scene, name, spheres, sphere_model.parts(name)))))
        elif sphere_model.fixed(name):
            pad = scene.link_padding.get(name, 0.0)
            still.append((name, frozenset(), sphere_model.kept(
                ("still", name, frames[link].tobytes(), pad),
                lambda name=name, link=link, pad=pad: tree_of(solids_of(_placed(sphere_model.fixed(name), frames[link]),
                                                                       pad)))))
    moving = [mover.name for mover in movers if not scene.link_padding.get(mover.name)
              and scene.link_scale.get(mover.name, 1.0) == 1.0]
    for body in state.attached.values():
        joint, pose = carriers[model.link_index[body.link]]
        coarse = set()
        if joint >= 0:
            spheres = _spheres_of(body.object, sphere_model.tolerance, patience, coarse)
            if len(spheres):
                movers.append(_Mover(body.id, body.touch_links, joint, _moved(spheres, pose @ body.object.pose, 0.0)))
        else:
            place = frames[model.link_index[body.link]] @ body.object.pose
            solids = solids_of(_placed(body.object.shapes, place), 0.0, patience,
                               lambda _, how, coarse=coarse: coarse.add(how))
            still.append((body.id, body.touch_links, tree_of(solids)))
        remarks += ["held object '%s' is planned around as %s" % (body.id, how) for how in sorted(coarse)]

    def may(a: Sequence[Any], b: Sequence[Any]) -> bool:
        return a[0] in b[1] or b[0] in a[1] or scene.allowed.allowed(a[0], b[0])

    mapped, maps = _maps(sphere_model, group, scene.allowed, moving)
    rows = []
    for mover in movers:
        patience.check()
        rows.append(tuple([may(mover, other) or frozenset((mover.name, other[0])) in mapped
                           for other in [*movers, *still]] + [mover.name in names for names in special.values()]))
    depth, branch = _branches(joints)
    clusters = sorted(_clusters(sphere_model, movers, rows, patience),
                      key=lambda cluster: (branch[cluster.joint], -depth[cluster.joint]))
    first = [movers.index(cluster.movers[0]) for cluster in clusters]
    pairs = [(a, b) for a in range(len(clusters)) for b in range(a + 1, len(clusters))
             if clusters[a].joint != clusters[b].joint and not rows[first[a]][first[b]]]
    table, spheres, skips = [], [], []
    for cluster in clusters:
        begin = len(spheres)
        balls, jumps = _made_once(sphere_model, _balls_and_jumps, cluster.spheres)
        spheres += balls
        skips += [begin + jump if jump else 0 for jump in jumps]
        table += [cluster.joint, begin, len(spheres)]
    arrays = (np.array([joint[:3] for joint in joints], np.int32).ravel(),
              np.array([joint[3] for joint in joints], np.float32).ravel(), np.array(table, np.int32),
              np.array([cluster.ball for cluster in clusters], np.float32).ravel(),
              np.array(spheres, np.float32).ravel(), np.array(skips, np.int32), tuple(branch))
    return _Robot(tuple(clusters), tuple(branch[cluster.joint] for cluster in clusters),
                  tuple(depth[cluster.joint] for cluster in clusters), arrays, np.array(pairs, np.int32).ravel(),
                  tuple(_Still(tree, tuple(rows[k][len(movers) + n] for k in first))
                        for n, (_, _, tree) in enumerate(still)), maps,
                  forest([tree for _, _, tree in still])), tuple(remarks)


def _maps(sphere_model: SphereModel, group: Group, allowed: AllowedCollisions,
          links: Iterable[str]) -> tuple[set[frozenset[str]], tuple[np.ndarray, np.ndarray]]:
    """Return (pairs of ``links`` as frozensets, (maps, cells)): those that maps check in place of spheres, see
    ``kernel``."""
    own = {int(index): number for number, index in enumerate(group.indices)}
    mapped, rows, cells = set(), [], [np.empty(0, np.uint8)]
    for a, b in itertools.combinations(links, 2):
        if allowed.allowed(a, b):
            continue
        found = sphere_model.maps((a, b), lambda a=a, b=b: pair_map(sphere_model, a, b))
        if found is not None and own.keys() >= set(found.variables):
            rows.append([*(own[variable] for variable in found.variables), sum(map(len, cells))])
            cells.append(found.closed.ravel())
            mapped.add(frozenset((a, b)))
    return mapped, (np.array(rows, np.int32).ravel(), np.concatenate(cells))


def _joints(model: PlanningModel, group: Group, state: State) -> tuple[list[_Joint], list[tuple[int, np.ndarray]]]:
    """Return the joints that the group moves [(parent, prismatic, variable, numbers)], and for each link of the model
    (the joint that it moves with or -1, its pose in that joint's frame)."""
    parents, origins, axes, kinds, variables, factors = model.kinematics
    own = {int(index): number for number, index in enumerate(group.indices)}
    joints, carriers = [], []
    for link, parent in enumerate(parents):
        joint, pose = (-1, state.base) if parent < 0 else carriers[parent]
        pose = pose @ origins[link]
        multiplier, offset = factors[link]
        variable = int(variables[link])
        if kinds[link] and variable in own:
            turn = np.eye(4)
            turn[:3, :3] = _rotation_taking_z_to(axes[link])
            entry = pose @ turn
            joints.append((joint, int(kinds[link] == 2), own[variable],
                           [*entry[:3, :3].ravel(), *entry[:3, 3], multiplier, offset]))
            joint, pose = len(joints) - 1, turn.T
        elif kinds[link]:
            value = offset + (multiplier * state.q[variable] if variable >= 0 else 0.0)
            pose = pose @ _motion(kinds[link], axes[link], value)
        carriers.append((joint, pose))
    return joints, carriers


def _branches(joints: Sequence[_Joint]) -> tuple[list[int], list[int]]:
    """Return for each joint its depth, and its root joint."""
    depth, branch = [], []
    for parent, *_ in joints:
        depth.append(0 if parent < 0 else depth[parent] + 1)
        branch.append(max(branch, default=-1) + 1 if parent < 0 else branch[parent])
    return depth, branch


def _rotation_taking_z_to(axis: np.ndarray) -> np.ndarray:
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _motion(kind: int, axis: np.ndarray, value: float) -> np.ndarray:
    pose = np.eye(4)
    if kind == 2:
        pose[:3, 3] = value * np.asarray(axis)
        return pose
    turn, (s, c) = _rotation_taking_z_to(axis), (math.sin(value), math.cos(value))
    pose[:3, :3] = turn @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ turn.T
    return pose


def _moved(spheres: np.ndarray, pose: np.ndarray, larger: float) -> np.ndarray:
    return np.column_stack([spheres[:, :3] @ pose[:3, :3].T + pose[:3, 3], spheres[:, 3] + larger])


def _padding(scene: Scene, link: str, spheres: np.ndarray, parts: Sequence[Placed]) -> float:
    """How much larger [m] the spheres of a link become: its padding, which reaches farther at the corners of boxes and
    the edges of cylinders, and the effect of its scale at the farthest point; a smaller scale has none."""
    larger, scale = scene.link_padding.get(link, 0.0), scene.link_scale.get(link, 1.0)
    corner = max((math.sqrt(3.0 if isinstance(geometry, Box) else 2.0) for geometry, _ in parts
                  if isinstance(geometry, Box | Cylinder)), default=1.0)
    if scale > 1.0:
        larger += (scale - 1.0) * float((np.linalg.norm(spheres[:, :3], axis=1) + spheres[:, 3]).max(initial=0.0))
    return corner * larger


def _made_once(sphere_model: SphereModel, function: Callable[[np.ndarray], T], spheres: np.ndarray) -> T:
    """``function(spheres)``: many tables of a robot have the same links in them."""
    key = function.__name__, hashlib.sha256(spheres.tobytes()).digest()
    return sphere_model.kept(key, lambda: function(spheres))


def _balls_and_jumps(spheres: np.ndarray) -> tuple[list[list[float]], list[int]]:
    """(balls [(4,)], jumps): ``_sphere_tree`` of ``spheres`` (n, 4) that begins at 0."""
    balls, jumps = [], []
    _sphere_tree(spheres, balls, jumps)
    return balls, jumps


def _clusters(sphere_model: SphereModel, movers: Sequence[_Mover], rows: Sequence[tuple[bool, ...]],
              patience: Patience) -> list[_Cluster]:
    """Return the _Clusters of ``movers``, whose ``rows`` say what each may touch."""
    found = []
    for number, mover in enumerate(movers):
        patience.check()
        alone = _Cluster(mover.joint, (mover,), mover.spheres, _made_once(sphere_model, ball, mover.spheres))
        for place, cluster in enumerate(found):
            # Two on one joint never collide; everything else must be equal for them.
            other = rows[movers.index(cluster.movers[0])]
            if cluster.joint != mover.joint or any(
                    a != b for k, (a, b) in enumerate(zip(rows[number], other, strict=True))
                    if k >= len(movers) or movers[k].joint != mover.joint):
                continue
            spheres = np.concatenate([cluster.spheres, mover.spheres])
            together = cluster._replace(movers=(*cluster.movers, mover), spheres=spheres,
                                        ball=_made_once(sphere_model, ball, spheres))
            if together.ball[3] <= _MERGED * max(cluster.ball[3], alone.ball[3]):
                found[place] = together
                break
        else:
            found.append(alone)
    return found


def _sphere_tree(some: np.ndarray, spheres: list[list[float]], skips: list[int]) -> None:
    """Append ``some`` (n, 4) to ``spheres`` and ``skips`` as a tree of balls, see ``kernel``; larger ones first."""
    if len(some) <= _FEW_SPHERES:
        spheres += some[np.argsort(-some[:, 3], kind="stable")].tolist()
        skips += [0] * len(some)
        return
    order = some[np.argsort(some[:, np.ptp(some[:, :3], axis=0).argmax()], kind="stable")]
    halves = order[: len(some) // 2], order[len(some) // 2 :]
    for half in sorted(halves, key=lambda half: -half[:, 3].max()):
        number = len(spheres)
        spheres.append(ball(half, steps=12).tolist())
        skips.append(0)
        _sphere_tree(half, spheres, skips)
        skips[number] = len(spheres)


def _spheres_of(item: WorldObject, tolerance: float, patience: Patience, coarse: set[str]) -> np.ndarray:
    """The spheres (n, 4) of an attached object, in its own frame. ``coarse`` (set) gets a sentence for each shape whose
    spheres are coarser than usual."""
    found = []
    for geometry, pose in item.shapes:
        patience.check()
        if isinstance(geometry, Plane):
            continue  # an infinite plane cannot be attached
        if isinstance(geometry, Octree):
            reach = 0.5 * math.sqrt(3.0) * geometry.boxes[:, 3]
            found.append(np.column_stack([geometry.boxes[:, :3] @ pose[:3, :3].T + pose[:3, 3], reach]))
            continue
        spheres, beyond = object_spheres([(pyramid(geometry) if isinstance(geometry, Cone) else geometry, pose)],
                                         tolerance, patience.late())
        found.append(spheres)
        if beyond is not None:
            coarse.add("spheres that reach up to %.3g m beyond it" % beyond)
    spheres = np.concatenate(found) if found else np.empty((0, 4))
    if len(spheres) > 2**_MAX_HALVINGS:
        coarse.add("%d spheres instead of %d" % (2**_MAX_HALVINGS, len(spheres)))
        return np.array([ball(some, steps=12) for some in _halved(spheres, _MAX_HALVINGS)])
    return spheres


def _halved(spheres: np.ndarray, times: int) -> list[np.ndarray]:
    """2**times groups of neighbours among ``spheres`` (n, 4)."""
    if not times:
        return [spheres]
    order = spheres[np.argsort(spheres[:, np.ptp(spheres[:, :3], axis=0).argmax()], kind="stable")]
    middle = len(order) // 2
    return [group for half in (order[:middle], order[middle:]) for group in _halved(half, times - 1)]


def _placed(parts: Iterable[tuple[Geometry | Boxes, np.ndarray]],
            pose: np.ndarray) -> list[tuple[Geometry | Boxes, np.ndarray]]:
    return [(geometry, pose @ inner) for geometry, inner in parts]
