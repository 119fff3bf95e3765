# SPDX-License-Identifier: BSD-3-Clause
"""A path from a start to one of some goals: found with spheres, and always checked by exact geometry."""
from __future__ import annotations

import itertools
import math
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.planners import kernels
from motion_planning.planners.constrained import ConstrainedPlanning
from motion_planning.planners.errors import NoPath
from motion_planning.planners.parts import TOGETHER, two_parts
from motion_planning.planners.trees import REACH, Path, TreeSearch, improve, rrt_connect, shorten
from motion_planning.planners.warming import warm_up
from motion_planning.scene import Scene
from motion_planning.spheres import Patience, SphereChecker, SphereModel, make_links

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.constraints import ConstraintSet
    from motion_planning.exact import ExactChecker
    from motion_planning.model import Group
    from motion_planning.planners.trees import Planner

# The share of the time for spheres; after that, a search by exact geometry alone begins.
_SHARE_OF_SPHERES = 0.7
# The share of the time after which what is not yet prepared of a scene is made as coarse as possible, and the same in
# s for requests without a limit. The preparation ends after all of the time, or this time [s] if that is longer, since
# scenes of thousands of objects must be planned for on slow machines too; the search has at least this share.
_SHARE_OF_TABLES, _TABLES_S, MIN_FOR_SCENE_S, SHARE_OF_SEARCH = 0.4, 5.0, 20.0, 0.3
# The share of the time within which a path may be made shorter.
_SHARE_TO_IMPROVE = 0.5
# After exact geometry has refused a path, the search is repeated with states on its edges closer by this factor each
# time.
_FINER = 0.5
_FINEST = 1.0 / 512.0
# Size of a step out of a contact of spheres [rad], and number of steps that are checked together.
_STEPS_OUT = (0.03, 0.4)
_CANDIDATES = 48
# Number of ways out of which the one with the most room at its end counts.
_WAYS_OUT = 8
_HOPS, _ROOM = 5, 16
# Number of samples after which other ways out are tried; each time half as many more.
_SAMPLES = 2000
# Edges that are checked by exact geometry alone are shorter: most of them fail.
_EXACT_REACH = 0.25
# Exact geometry checks one in this many states of a path even if spheres prove them free; number of states per call.
_SEEN, _AT_ONCE = 8, 64

# Polling period while another thread prepares the robot [s].
_LOOK_UP_S = 0.05

_sphere_models, _checkers, _made_links = (weakref.WeakKeyDictionary() for _ in range(3))
_sphere_models_lock, _checkers_lock = threading.Lock(), threading.Lock()


class SearchOptions(NamedTuple):
    """Options of a search. exact: ExactChecker. seed: the same one gives the same path if the time suffices.
    allowed_time [s] on ``clock``, a function that returns seconds. stop: called every few ms; true ends the search.
    constraints: ConstraintSet for every state on the path, or None. planner: a function like ``rrt_connect`` that
    searches with spheres (``names.planner_of``); with constraints, another one is used. improve: whether to make the
    first path that is found shorter for some 20 ms, if the time allows it."""

    exact: ExactChecker
    seed: int
    allowed_time: float
    clock: Callable[[], float]
    stop: Callable[[], bool] = lambda: False
    constraints: ConstraintSet | None = None
    planner: Planner = rrt_connect
    improve: bool = False


def sphere_model_of(exact: ExactChecker) -> SphereModel:
    """Return the SphereModel of an ExactChecker's robot, made once."""
    with _sphere_models_lock:
        if exact not in _sphere_models:
            _sphere_models[exact] = SphereModel.of(exact.model, exact.meshes)
        return _sphere_models[exact]


def checker_of(exact: ExactChecker, scene: Scene, group: Group, patience: Patience | None = None) -> SphereChecker:
    """Return the SphereChecker of a Group in a scene, made once for each scene and group. patience: spheres.Patience
    with that; None: it gets coarse after some seconds."""
    with _checkers_lock:
        known = _checkers.setdefault(scene, {})
    # Nobody waits for another's scene.
    if group.name not in known:
        end = time.monotonic() + _TABLES_S
        made = SphereChecker(sphere_model_of(exact), group, scene,
                             patience=patience or Patience(late=lambda: time.monotonic() > end))
        known.setdefault(group.name, made)
    return known[group.name]


def _make_links(exact: ExactChecker, scene: Scene, group: Group, stop: Callable[[], bool]) -> None:
    """Make what of a robot does not depend on the scene. Most callers have done so before, by ``prepare``; where
    another thread is at it, this one waits. Raises NoPath if it is stopped then."""
    with _sphere_models_lock:
        made, making = _made_links.setdefault(exact, (set(), threading.Lock()))
    if group.name in made:
        return
    while not making.acquire(timeout=_LOOK_UP_S):
        if stop():
            raise NoPath("stopped while the robot was prepared for planning", stopped=True)
    try:
        if group.name not in made:
            make_links(sphere_model_of(exact), group, scene.allowed)
            made.add(group.name)
    finally:
        making.release()


def first_touching(exact: ExactChecker, scene: Scene, group: Group, states: ArrayLike) -> int | None:
    """Return the index of the first of ``states`` (m, k) of the Group that is in collision, None if there is none.
    Spheres prove most states free and exact geometry decides on the others, so dense states cost little."""
    doubtful = np.flatnonzero(~checker_of(exact, scene, group).valid(states))
    first = exact.first_blocked(scene, np.asarray(states)[doubtful], group.name) if len(doubtful) else None
    return None if first is None else int(doubtful[first])


def prepare(exact: ExactChecker) -> None:
    """Make all data that do not depend on a scene, so that the first plan is not delayed: spheres of links, maps of
    pairs of them, compiled code."""
    spheres = sphere_model_of(exact)
    for link in exact.model.links:
        spheres.spheres(link)
        spheres.fixed(link)
    for group in exact.model.groups.values():
        SphereChecker(spheres, group, Scene(exact.model))
    warm_up()


def plan_path(scene: Scene, group: str, start: np.ndarray, goals: np.ndarray, search: SearchOptions) -> Path:
    """Return a Path from ``start`` (k,) to one of ``goals`` (g, k) of the group named ``group``.

    Its times are of "tables", "ends" (the exact check of start and goals), "way out", "search", "shorten", "exact" and
    "improve".

    It is found and shortened with spheres that contain the robot. Then ``search.exact`` checks states between those of
    the search, at the same distance: each corner, every eighth, and all states that spheres do not prove free. If the
    start is free by exact geometry but not by spheres, the path leads out of there by exact geometry. With
    ``search.constraints``, start and goals must satisfy them, and the points of the path are as dense as needed. The
    scene's preparation counts against the time; what of it takes too long is made coarser, which the path's remarks
    tell. Raises NoPath, whose text has the remarks as well.
    """
    planning = _Planning(scene, group, search)
    try:
        return planning.path(start, goals)._replace(remarks=planning.checker.remarks)
    except NoPath as error:
        raise NoPath("; ".join([str(error), *planning.checker.remarks]), error.late, error.stopped) from None


class _Planning:
    def __init__(self, scene: Scene, group: str, search: SearchOptions) -> None:
        self.scene, self.search, self.model = scene, search, scene.model
        self.group = self.model.group(group)
        # The first plan of a robot may have to make its spheres: that must not use up its time.
        _make_links(search.exact, scene, self.group, search.stop)
        self.begin = self.last = search.clock()
        self.times = {}
        self.random = np.random.default_rng(search.seed & (1 << 63) - 1)
        end = self.begin + max(search.allowed_time, MIN_FOR_SCENE_S)
        preparing = TreeSearch(search.seed, end, search.clock, search.stop)
        self.checker = checker_of(search.exact, scene, self.group, Patience(
            lambda: not self._left(_SHARE_OF_TABLES), lambda: preparing.check("the scene was prepared for planning")))
        self._note("tables")
        self.begin += max(0.0, self.times["tables"] - (1.0 - SHARE_OF_SEARCH) * search.allowed_time)
        self.bounds = np.array(self.model.bounds[self.group.indices])

    def path(self, start: np.ndarray, goals: np.ndarray) -> Path:
        start, goals = self._postures(start, goals)
        self._free_or_raise("the start", [start])
        goals = self._free_or_raise("every goal" if len(goals) > 1 else "the goal", goals)
        self._note("ends")
        if self.search.constraints is not None:
            found = ConstrainedPlanning(self.scene, self.group, self.checker, self.search,
                                        self.search.constraints).path(start, goals)
            self._note("search")
            return found._replace(times=self.times)
        try:
            return self._by_spheres(start, goals)._replace(times=self.times)
        except NoPath as error:
            if error.stopped or not self._left(1.0):
                raise
        found = self._by_exact(start, goals)
        self._note("search")
        return found._replace(times=self.times)

    # -- ends ---------------------------------------------------------------------------------------------------

    def _postures(self, start: ArrayLike, goals: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """The arrays, with continuous joints moved to the turn that is nearest to the start."""
        start, goals = np.array(start, dtype=float), np.atleast_2d(np.array(goals, dtype=float))
        count = len(self.group)
        if start.shape != (count,) or goals.shape[1:] != (count,) or not len(goals):
            raise NoPath("start and goals of group '%s' need %d values each, got arrays of shape %s and %s"
                         % (self.group.name, count, start.shape, goals.shape))
        if not (np.isfinite(start).all() and np.isfinite(goals).all()):
            raise NoPath("start or goal of group '%s' has values that are not finite" % self.group.name)
        turns = np.flatnonzero(self.model.continuous[self.group.indices])
        goals[:, turns] -= 2.0 * math.pi * np.round((goals[:, turns] - start[turns]) / (2.0 * math.pi))
        ends = np.concatenate([start[None], goals])
        # A start slightly beyond a limit may move back.
        self.bounds[:, 0] = np.minimum(self.bounds[:, 0], ends.min(axis=0))
        self.bounds[:, 1] = np.maximum(self.bounds[:, 1], ends.max(axis=0))
        self.bounds[turns, 0] = ends[:, turns].min(axis=0) - math.pi
        self.bounds[turns, 1] = ends[:, turns].max(axis=0) + math.pi
        return start, goals

    def _free_or_raise(self, what: str, postures: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
        free = [q for q in postures if self._exact_free(q)]
        if not free:
            state = self.scene.state.with_q(postures[0], self.group.indices)
            contacts = self.search.exact.contacts(self.scene, state, self.group.name, most=1)
            raise NoPath("%s is in collision%s" % (what, ": %s" % contacts[0] if contacts else ""))
        return np.array(free)

    # -- searches ----------------------------------------------------------------------------------------

    def _by_spheres(self, start: np.ndarray, goals: np.ndarray) -> Path:
        run = self._run(_SHARE_OF_SPHERES)
        outwards, inwards = self._ways(start, goals, run)
        checker, seed, samples = self.checker, self.search.seed, _SAMPLES
        while True:
            entries = np.array([way[0] for way in inwards])
            try:
                # Where ends lead out of narrow places, other ways out may be much better.
                most = samples if len(outwards) + sum(map(len, inwards)) > 1 + len(inwards) else math.inf
                found = self._found(checker, outwards[-1], entries, run._replace(seed=seed, samples=most))
            except NoPath as error:
                if not error.spent:
                    raise
                self._note("search")
                outwards, inwards = self._ways(start, goals, run, with_room=True)
                samples, seed = 1.5 * samples, seed + 1
                continue
            self._note("search")
            within = found.times.get("shorten")
            short = shorten(found, checker, run._replace(seed=seed), *(() if within is None else TOGETHER))
            self._note("shorten")
            within = within or 0.0
            self.times["shorten"] += within
            self.times["search"] -= within
            inward = inwards[int(np.abs(entries - short.points[-1]).max(axis=1).argmin())]
            path = _between_ways(outwards, short, inward)
            free = self._path_is_free(path.points, run)
            self._note("exact")
            if free:
                return self._improved(path, short, (checker, run._replace(seed=seed)), (outwards, inward))
            run.check("a path was looked for that exact geometry agrees with")
            checker, seed = checker.at(max(_FINEST, _FINER * checker.resolution)), seed + 1

    def _improved(self, path: Path, short: Path, how: tuple[SphereChecker, TreeSearch],
                  ways: tuple[np.ndarray, np.ndarray]) -> Path:
        """``path``, or a shorter one if there is time: ``short`` improved, between two ``ways``. how: checker,
        TreeSearch."""
        checker, run = how
        run = run._replace(deadline=self.begin + _SHARE_TO_IMPROVE * self.search.allowed_time)
        if not self.search.improve or not self._left(_SHARE_TO_IMPROVE):
            return path
        better = _between_ways(ways[0], improve(short, checker, run), ways[1])
        try:
            return better if self._path_is_free(better.points, run) else path
        except NoPath as error:
            if error.stopped:
                raise
            return path
        finally:
            self._note("improve")

    def _ways(self, start: np.ndarray, goals: np.ndarray, run: TreeSearch,
              with_room: bool = False) -> tuple[np.ndarray, list[np.ndarray]]:
        """(way from the start to where spheres are free, ways from there to the goals); goals without one are left
        out. with_room: see ``_way_out``."""
        outwards, inwards = self._way_out(start, run, with_room), []
        for last, goal in enumerate(goals, 1 - len(goals)):
            try:
                inwards.append(self._way_out(goal, run, with_room)[::-1])
            except NoPath as error:
                if error.stopped or last == 0 and not inwards:
                    raise
        self._note("way out")
        return outwards, inwards

    def _found(self, checker: SphereChecker, start: np.ndarray, goals: np.ndarray, run: TreeSearch) -> Path:
        """A Path by spheres to one of ``goals``."""
        if self.search.planner is rrt_connect and len(checker.parts) == 2:
            return two_parts(checker, self.bounds, start, goals, run, REACH)
        return self.search.planner(checker, self.bounds, start, goals, run)

    def _way_out(self, q: np.ndarray, run: TreeSearch, with_room: bool = False) -> np.ndarray:
        """Points (m, k) from ``q``, free by exact geometry, to the first that is free by spheres; with_room: to the one
        of several with the most room around it, and on to where there is more."""
        if self.checker.valid(q)[0]:
            return np.array([q])
        nodes, parents = [q], [-1]
        while True:
            run.check("a way was looked for out of where the robot nearly touches something")
            parent = int(self.random.integers(len(nodes)))
            some = self._around(nodes[parent])
            free = self.checker.valid(some)
            # The shortest steps that lead out, else one that leads further.
            order = np.argsort(np.linalg.norm(some - nodes[parent], axis=1))
            outside = [some[k] for k in order if free[k]]
            found = (one for one in outside[:_WAYS_OUT] if self._edge_is_free(nodes[parent], one))
            ways = list(found if with_room else itertools.islice(found, 1))
            if ways:
                return np.concatenate([self._traced(nodes, parents, parent)[::-1],
                                       self._to_room(ways) if with_room else ways])
            for one in some[order][~free[order]][:1]:
                if self._edge_is_free(nodes[parent], one):
                    nodes.append(one)
                    parents.append(parent)

    def _to_room(self, ways: list[np.ndarray]) -> np.ndarray:
        """Points (m, k) from one of the postures ``ways``, free by spheres, to one that has more room around it."""
        found, best = [], -1
        for _ in range(_HOPS):
            room = [int(self.checker.valid(self._around(one)).sum()) for one in ways]
            if max(room, default=-1) <= best:
                break
            best = max(room)
            found.append(ways[room.index(best)])
            if best >= _ROOM:
                break
            some = self._around(found[-1])
            ways = [one for one in some[self.checker.valid(some)][:_WAYS_OUT] if self.checker.edge(found[-1], one)]
        return np.array(found)

    def _around(self, q: np.ndarray) -> np.ndarray:
        """Random postures (_CANDIDATES, k) at different distances from ``q``."""
        away = self.random.normal(size=(_CANDIDATES, len(q)))
        away *= self.random.uniform(*_STEPS_OUT, (_CANDIDATES, 1)) / np.linalg.norm(away, axis=1, keepdims=True)
        return np.clip(q + away, self.bounds[:, 0], self.bounds[:, 1])

    def _by_exact(self, start: np.ndarray, goals: np.ndarray) -> Path:
        """RRT-Connect with exact geometry only: slow, for gaps that are too narrow for spheres."""
        run = self._run(1.0)
        trees: list[tuple[list[np.ndarray], list[int]]] = [([start], [-1]), (list(goals), [-1] * len(goals))]
        grown = 0
        while True:
            run.check("a path was looked for by exact geometry: spheres around the robot found none")
            grown = 0 if len(trees[0][0]) <= len(trees[1][0]) else 1
            sample = self.random.uniform(self.bounds[:, 0], self.bounds[:, 1])
            new = self._extend(*trees[grown], sample)
            if new is None:
                continue
            target = trees[grown][0][new]
            while (other := self._extend(*trees[1 - grown], target)) is not None:
                if np.array_equal(trees[1 - grown][0][other], target):
                    ends = (new, other) if grown == 0 else (other, new)
                    ways = [self._traced(*tree, end) for tree, end in zip(trees, ends, strict=True)]
                    points = np.concatenate([ways[0][::-1], ways[1][1:]])
                    return Path(self._shortened(points, run))
                run.check("a path was looked for by exact geometry")

    def _extend(self, nodes: list[np.ndarray], parents: list[int], target: np.ndarray) -> int | None:
        apart = np.linalg.norm(np.array(nodes) - target, axis=1)
        parent = int(apart.argmin())
        near = nodes[parent]
        new = target if apart[parent] <= _EXACT_REACH else near + (target - near) * (_EXACT_REACH / apart[parent])
        if apart[parent] == 0.0 or not self._edge_is_free(near, new):
            return None
        nodes.append(new)
        parents.append(parent)
        return len(nodes) - 1

    def _shortened(self, points: np.ndarray, run: TreeSearch) -> np.ndarray:
        """The path without the corners that exact geometry does not need, within the time limit."""
        k = 0
        while k + 2 < len(points):
            try:
                run.check("a path was shortened")
            except NoPath:
                break
            if self._edge_is_free(points[k], points[k + 2]):
                points = np.delete(points, k + 1, axis=0)
            else:
                k += 1
        return points

    @staticmethod
    def _traced(nodes: list[np.ndarray], parents: list[int], node: int) -> np.ndarray:
        way = []
        while node >= 0:
            way.append(nodes[node])
            node = parents[node]
        return np.array(way)

    # -- exact geometry -----------------------------------------------------------------------------------------

    def _exact_free(self, q: np.ndarray) -> bool:
        return self.search.exact.free(self.scene, self.scene.state.with_q(q, self.group.indices), self.group.name)

    def _edge_is_free(self, a: np.ndarray, b: np.ndarray) -> bool:
        count = max(1, math.ceil(np.linalg.norm(b - a) / (0.5 * self.checker.resolution)))
        # Far end first: it is new.
        return self._all_free(a + (b - a) * (np.arange(count, 0, -1) / count)[:, None])

    def _all_free(self, states: np.ndarray) -> bool:
        return self.search.exact.first_blocked(self.scene, states, self.group.name) is None

    def _path_is_free(self, points: np.ndarray, run: TreeSearch) -> bool:
        """Whether the path is free by exact geometry, at states between those that spheres have checked. Spheres
        contain the robot: if they are free, so is the robot. Exact geometry checks all other states, and in any case
        every eighth state and each corner.
        """
        states, corners = kernels.between_checked(points, self.checker.resolution)
        doubtful = ~self.checker.valid(states)
        some = np.zeros(len(states), dtype=bool)
        some[::_SEEN], some[corners] = True, True
        # States that spheres do not prove free are the most likely collisions.
        order = np.concatenate([np.flatnonzero(doubtful), np.flatnonzero(some & ~doubtful)])
        for begin in range(0, len(order), _AT_ONCE):
            run.check("a path was checked by exact geometry")
            if not self._all_free(states[order[begin : begin + _AT_ONCE]]):
                return False
        return True

    # -- time ---------------------------------------------------------------------------------------------------

    def _run(self, share: float) -> TreeSearch:
        return TreeSearch(self.search.seed, self.begin + share * self.search.allowed_time, self.search.clock,
                          self.search.stop)

    def _note(self, part: str) -> None:
        """Add the time since the last note to that of a part of the work."""
        now = self.search.clock()
        self.times[part] = self.times.get(part, 0.0) + now - self.last
        self.last = now

    def _left(self, share: float) -> bool:
        return self.search.clock() < self.begin + share * self.search.allowed_time


def _between_ways(outwards: np.ndarray, path: Path, inward: np.ndarray) -> Path:
    """The Path, which begins where the points ``outwards`` end, with these and those ``inward`` from its end."""
    return path._replace(points=np.concatenate([outwards, path.points[1:-1], inward]))
