# SPDX-License-Identifier: BSD-3-Clause
"""From a planning request to a timed trajectory, or to the reason of a failure."""
from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.constraints.manifold import Manifold
from motion_planning.errors import PlanningError
from motion_planning.planners import NoPath, SearchOptions, first_touching, rrt_connect
from motion_planning.planners.planning import MIN_FOR_SCENE_S, SHARE_OF_SEARCH
from motion_planning.scene import Scene
from motion_planning.timing import Timed, time_path

if TYPE_CHECKING:
    from motion_planning.constraints import ConstraintSet, Sampler
    from motion_planning.exact import Contact, ExactChecker
    from motion_planning.model import State
    from motion_planning.planners import Path
    from motion_planning.planners.trees import Planner

    #: A sentence on an invalid state, and the contacts there.
    Flaw = tuple[str, list[Contact]]

# Allowed cutting of corners [rad or m], tried in this order: a curve in collision gets a smaller one.
_CORNERS = (0.05, 0.01, 0.001)
# Greatest distance of checked states of the timed trajectory [rad or m, in any joint]: by exact geometry; for path
# constraints; and of states in between, which exact geometry checks only if spheres are not free.
_RESOLUTION, _CONSTRAINED, _BETWEEN = 0.03, 0.01, 0.003
# Number of goal postures for a planner, and time limit [s] of the search for more than one.
_GOALS, _MORE_GOALS_S = 8, 0.02
# Share of the allowed time for goal postures, and number of random states around a start in collision.
_SHARE_FOR_GOALS, _JIGGLES = 0.5, 100
# Number of paths to time before the request fails, if timed trajectories are not valid.
_MAX_PATHS = 4
# Number of states that are checked between two looks at whether to stop.
_AT_ONCE = 64
# Greatest number of contacts in a sentence.
_NAMED = 3


class Code(enum.IntEnum):
    """Values of moveit_msgs/MoveItErrorCodes that planning returns."""

    SUCCESS = 1
    FAILURE = 99999
    PLANNING_FAILED = -1
    INVALID_MOTION_PLAN = -2
    TIMED_OUT = -6
    PREEMPTED = -7
    START_STATE_IN_COLLISION = -10
    START_STATE_VIOLATES_PATH_CONSTRAINTS = -11
    GOAL_IN_COLLISION = -12
    GOAL_VIOLATES_PATH_CONSTRAINTS = -13
    GOAL_CONSTRAINTS_VIOLATED = -14
    INVALID_GROUP_NAME = -15
    INVALID_GOAL_CONSTRAINTS = -16
    INVALID_ROBOT_STATE = -17
    INVALID_LINK_NAME = -18
    START_STATE_INVALID = -26
    NO_IK_SOLUTION = -31


class PlanningFailure(PlanningError):
    """Why there is no plan. code: a :class:`Code`; contacts: exact.Contacts of the failure; joints: {joint: value}
    beyond their limits."""

    def __init__(self, code: int, text: str, contacts: Iterable[Contact] = (),
                 joints: Mapping[str, float] | None = None) -> None:
        super().__init__(text)
        self.code, self.contacts, self.joints = code, list(contacts), dict(joints or {})


@dataclass(frozen=True, eq=False)
class PlanQuery:
    """A planning request.

    scene: Scene with the robot at the start; group: name; goals: ConstraintSets, one of which must be met.
    path_constraints: ConstraintSet for the whole path, or None. planner: as in SearchOptions. allowed_time [s];
    attempts: plans of which the shortest counts. velocity_scaling, acceleration_scaling: 0 < f <= 1. timing: algorithm
    of timing.time_path.
    start_bounds_error: by how much [rad or m] the start may be beyond a limit; it is moved onto the limit.
    jiggle: share of a joint's range within which a start in collision is moved to a free one.
    planner_id: the command, if `industrial` plans.
    """

    scene: Scene
    group: str
    goals: list[ConstraintSet]
    path_constraints: ConstraintSet | None = None
    planner: Planner = rrt_connect
    allowed_time: float = 5.0
    attempts: int = 1
    velocity_scaling: float = 1.0
    acceleration_scaling: float = 1.0
    timing: str = "ruckig"
    start_bounds_error: float = 0.05
    jiggle: float = 0.02
    planner_id: str = ""


@dataclass(frozen=True, eq=False)
class Tools:
    """The tools of planning: exact: ExactChecker; plan_path, sampler: as in planners and constraints; clock: function
    that returns the time [s]; seed: of the random numbers; stop(): true ends the planning."""

    exact: ExactChecker
    plan_path: Callable[[Scene, str, np.ndarray, np.ndarray, SearchOptions], Path]
    sampler: Callable[..., Sampler]
    clock: Callable[[], float]
    seed: int = 0
    stop: Callable[[], bool] = field(default=lambda: False)


class Plan(NamedTuple):
    """start: State of the whole robot; path (m, k) of the group's joints; timed: timing.Timed; planning_time [s];
    remarks: sentences on what was planned more coarsely than usual."""

    start: State
    path: np.ndarray
    timed: Timed
    planning_time: float
    remarks: tuple[str, ...] = ()


def plan(query: PlanQuery, tools: Tools) -> Plan:
    """Return a :class:`Plan` for a :class:`PlanQuery`. Raises PlanningFailure.

    The returned trajectory is not only checked by an approximation: its states, sampled as in a controller, are free of
    collisions in ``tools.exact``.
    """
    return _Planning(query, tools).run()


def checked(query: PlanQuery, tools: Tools, timed: Timed, until: float) -> Flaw | None:
    """Return None, or (sentence, contacts) of the first state of a Timed up to its time ``until`` [s] that touches
    something in the query's scene, is beyond a limit or breaks a path constraint."""
    return _Planning(query, tools).first_hit(query.scene, timed, False, until)


class _Planning:
    """One request while it is planned."""

    def __init__(self, query: PlanQuery, tools: Tools) -> None:
        self.query, self.tools = query, tools
        self.model = query.scene.model
        self.begin = tools.clock()
        self.spared, self.remarks = 0.0, ()
        if query.group not in self.model.groups:
            raise PlanningFailure(Code.INVALID_GROUP_NAME, "robot '%s' has no group '%s'; its groups are %s" % (
                self.model.name, query.group, ", ".join(self.model.groups) or "none"))
        self.group = self.model.groups[query.group]
        self.names, self.indices = self.group.joints, self.group.indices
        if not self.names:
            raise PlanningFailure(Code.INVALID_GROUP_NAME, "group '%s' has no joint that moves" % query.group)

    def run(self) -> Plan:
        query = self.query
        if not (math.isfinite(query.allowed_time) and query.allowed_time > 0.0):
            raise PlanningFailure(Code.FAILURE, "the allowed planning time is %r s; it must be above 0"
                                  % query.allowed_time)
        if not query.goals:
            raise PlanningFailure(Code.INVALID_GOAL_CONSTRAINTS, "the request has no goal constraints")
        scene, lead = self._start()
        start = scene.state.q[self.indices]
        if self._is_met(scene.state, scene):
            return self._timed(scene, lead, start[None])
        goals = self._goals(scene)
        paths = []
        for attempt in range(max(1, min(query.attempts, 50))):
            if paths and (self._used() > 0.5 * query.allowed_time or self.tools.stop()):
                break
            try:
                paths.append(self._path(scene, start, goals, attempt))
            except PlanningFailure:
                if not paths:
                    raise
                break
        paths.sort(key=lambda path: float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()))
        for attempt in itertools.count(len(paths)):
            try:
                return self._timed(scene, lead, paths.pop(0))
            except PlanningFailure as failure:
                if failure.code != Code.INVALID_MOTION_PLAN or not paths and attempt >= _MAX_PATHS:
                    raise
                if not paths:
                    self._raise_if_stopped()
                    paths.append(self._path(scene, start, goals, attempt))
        raise AssertionError("not reached")

    # -- start --------------------------------------------------------------------------------------------------

    def _start(self) -> tuple[Scene, np.ndarray]:
        """Return (scene with a valid start, the states (m, k) from the robot's state to it)."""
        scene = self._within_limits(self.query.scene)
        q = self.query.scene.state.q[self.indices]
        lead = np.empty((0, len(q))) if scene is self.query.scene else q[None]
        self.tools.exact.prepare(scene, self.query.group, self._check_shapes_in_time)
        self.spared = max(0.0, self._elapsed() - (1.0 - SHARE_OF_SEARCH) * self.query.allowed_time)
        contacts = self.tools.exact.contacts(scene, scene.state, self.query.group)
        if contacts:
            free = self._free_near(scene)
            if free is None:
                raise PlanningFailure(Code.START_STATE_IN_COLLISION, "the start state is in collision: %s; move the "
                                      "robot or allow the two to touch" % _named(contacts), contacts)
            lead, scene = q[None], scene.with_state(scene.state.with_q(free, self.indices))
        violated = self._violated(self.query.path_constraints, scene.state, scene)
        if violated:
            raise PlanningFailure(Code.START_STATE_VIOLATES_PATH_CONSTRAINTS,
                                  "the start state violates the path constraints: %s" % violated)
        return scene, lead

    def _within_limits(self, scene: Scene) -> Scene:
        q = scene.state.q
        bad = self.model.beyond_limits(q, self.query.start_bounds_error, self.indices)
        if bad:
            sentence = ", ".join("joint '%s' is at %.4f, its limits are %.4f and %.4f" % one for one in bad)
            raise PlanningFailure(Code.START_STATE_INVALID, "the start state is out of bounds: %s (%.3g more is let "
                                  "pass)" % (sentence, self.query.start_bounds_error), joints={b[0]: b[1] for b in bad})
        inside = np.clip(q, *self.model.bounds.T)
        inside = np.where(self.model.continuous, q, inside)[self.indices]
        if np.array_equal(inside, q[self.indices]):
            return scene
        return scene.with_state(scene.state.with_q(inside, self.indices))

    def _free_near(self, scene: Scene) -> np.ndarray | None:
        """Return a free posture (k,) near the scene's, or None."""
        random = np.random.default_rng(self.tools.seed)
        low, high = self.model.bounds[self.indices].T
        q = scene.state.q[self.indices]
        for i in range(_JIGGLES):
            reach = self.query.jiggle * (high - low) * (i + 1) / _JIGGLES
            near = np.clip(q + reach * random.uniform(-1.0, 1.0, len(q)), low, high)
            if self.tools.exact.free(scene, scene.state.with_q(near, self.indices), self.query.group):
                return near
            self._raise_if_stopped()
        return None

    # -- goals --------------------------------------------------------------------------------------------------

    def _goals(self, scene: Scene) -> np.ndarray:
        """Return postures (g, k) that meet one of the goals and are free of collisions."""
        found, failures = [], []
        for goal in self.query.goals:
            try:
                samples = self._samples(goal, scene, self.tools.exact, _SHARE_FOR_GOALS)
                found += self._some(samples, goal, scene, len(self.query.goals))
            except PlanningFailure as failure:
                if failure.code == Code.PREEMPTED:
                    raise
                failures.append(failure)
            except PlanningError as error:
                failures.append(PlanningFailure(Code.INVALID_GOAL_CONSTRAINTS, str(error)))
        if found:
            return np.array(found)
        if failures:
            raise failures[0]
        raise self._why_no_goal(scene)

    def _some(self, samples: Iterable[np.ndarray], goal: ConstraintSet, scene: Scene, sets: int) -> list[np.ndarray]:
        found, begin = [], self._elapsed()
        refused, path = "", self.query.path_constraints
        for q in samples:
            self._raise_if_stopped()
            violated = self._violated(path, scene.state.with_q(q, self.indices), scene)
            q = self._brought_back(q, goal, path, scene) if path is not None and violated else np.array(q)
            if q is None:
                refused = violated
            else:
                found.append(q)
            late = self._elapsed() - begin
            if len(found) >= max(1, _GOALS // sets) or found and late > _MORE_GOALS_S or \
                    late > _SHARE_FOR_GOALS * self.query.allowed_time / sets:
                break
        if refused and not found:
            raise PlanningFailure(Code.GOAL_VIOLATES_PATH_CONSTRAINTS,
                                  "no posture of the goal keeps the path constraints: %s" % refused)
        return found

    def _brought_back(self, q: np.ndarray, goal: ConstraintSet, path: ConstraintSet,
                      scene: Scene) -> np.ndarray | None:
        """Return a free posture (k,) near ``q`` that meets a goal and the path constraints, None if none is found."""
        near = Manifold(scene, self.group, goal.merged(path), q).project(q)
        if near is None:
            return None
        state = scene.state.with_q(near, self.indices)
        if self._violated(goal, state, scene) or self._violated(path, state, scene):
            return None
        return near if self.tools.exact.free(scene, state, self.query.group) else None

    def _why_no_goal(self, scene: Scene) -> PlanningFailure:
        """Return the PlanningFailure of the goal that passed the most stages."""
        unreached = None
        for goal in self.query.goals:
            samples = self._samples(goal, scene, None, 1.0)
            q = next(iter(samples), None)
            if q is None and self._is_over():
                break
            if q is None:
                why = getattr(samples, "reason", None)
                self._raise_if_stopped()
                by_joints = getattr(goal, "joints", ()) and not (goal.positions or goal.orientations)
                code = Code.NO_IK_SOLUTION if why and not by_joints else Code.GOAL_CONSTRAINTS_VIOLATED
                unreached = unreached or PlanningFailure(code, "no posture of group '%s' meets the goal: %s" % (
                    self.query.group, why or "its constraints leave none"))
                continue
            state = scene.state.with_q(q, self.indices)
            contacts = self.tools.exact.contacts(scene, state, self.query.group)
            if contacts:
                return PlanningFailure(Code.GOAL_IN_COLLISION, "the goal is in collision: %s" % _named(contacts),
                                       contacts)
            violated = self._violated(goal, state, scene)
            if violated:
                unreached = unreached or PlanningFailure(Code.GOAL_CONSTRAINTS_VIOLATED, violated)
        return unreached or PlanningFailure(Code.TIMED_OUT, "no posture of the goal was found within %.2f s"
                                            % (_SHARE_FOR_GOALS * self.query.allowed_time))

    def _samples(self, goal: ConstraintSet, scene: Scene, exact: ExactChecker | None, share: float) -> Sampler:
        return self.tools.sampler(self.model, self.query.group, goal, scene, exact, self.tools.seed,
                                  stop=lambda: self._is_over(share))

    def _is_met(self, state: State, scene: Scene) -> bool:
        return any(not self._violated(goal, state, scene) for goal in self.query.goals)

    def _violated(self, constraints: ConstraintSet | None, state: State, scene: Scene) -> str:
        """Return the sentence on the first constraint that ``state`` violates, or an empty one."""
        if constraints is None:
            return ""
        evaluated = constraints.evaluate(self.model, state, scene, self.tools.exact)
        return next((sentence for satisfied, _, sentence in evaluated if not satisfied), "")

    # -- path ---------------------------------------------------------------------------------------------------

    def _path(self, scene: Scene, start: np.ndarray, goals: np.ndarray, attempt: int) -> np.ndarray:
        left = self.query.allowed_time - self._used()
        search = SearchOptions(exact=self.tools.exact, seed=self.tools.seed + attempt, allowed_time=max(left, 0.01),
                               clock=self.tools.clock, stop=self.tools.stop, constraints=self.query.path_constraints,
                               planner=self.query.planner, improve=True)
        try:
            path = self.tools.plan_path(scene, self.query.group, start, goals, search)
        except NoPath as error:
            self._raise_if_stopped()
            late = self._used() >= 0.98 * self.query.allowed_time
            raise PlanningFailure(Code.TIMED_OUT if late else Code.PLANNING_FAILED, str(error)) from None
        self.remarks = getattr(path, "remarks", ())
        return np.asarray(getattr(path, "points", path), dtype=float)

    def _timed(self, scene: Scene, lead: np.ndarray, path: np.ndarray) -> Plan:
        velocity = self.model.velocity[self.indices] * self.query.velocity_scaling
        acceleration = self.model.acceleration[self.indices] * self.query.acceleration_scaling
        whole = np.concatenate([lead, path])
        flaw: Flaw = "", []
        through = self.query.timing.startswith("iterative")  # the points are dense, so its splines stay near the lines
        ways = [(self.query.timing, tolerance) for tolerance in _CORNERS]
        if self.query.path_constraints is not None and not through:
            # For very tight constraints: through every point of a dense path.
            ways.append(("iterative_time_parameterization", _CORNERS[-1]))
        for timing, tolerance in ways:
            self._raise_if_stopped()
            points = _dense(whole, 2.0 * tolerance) if timing.startswith("iterative") else whole
            timed = time_path(points, velocity, acceleration, timing, tolerance=tolerance)
            hit = self.first_hit(scene, timed, len(lead) > 0)
            if hit is None:
                return Plan(self.query.scene.state, whole, timed, self._elapsed(), self.remarks)
            flaw = hit
        raise PlanningFailure(Code.INVALID_MOTION_PLAN, "a path was found, but the timed trajectory is not valid: %s"
                              % flaw[0], flaw[1])

    def first_hit(self, scene: Scene, timed: Timed, from_collision: bool, until: float = math.inf) -> Flaw | None:
        """Return None, or (sentence, contacts) of the first invalid state of a trajectory up to ``until`` [s]."""
        step = _RESOLUTION if self.query.path_constraints is None else _CONSTRAINED
        states = _states(timed, step, until)
        low, high = self.model.bounds[self.indices].T
        turns = self.model.continuous[self.indices]
        # A start slightly beyond a limit is led back.
        low, high = np.where(turns, -np.inf, np.minimum(low, states[0])), np.where(turns, np.inf,
                                                                                  np.maximum(high, states[0]))
        beyond = np.argwhere((states < low - 1e-6) | (states > high + 1e-6))
        if len(beyond):
            at, joint = beyond[0]
            return "joint '%s' reaches %.4f, its limits are %.4f and %.4f" % (
                self.names[joint], states[at, joint], low[joint], high[joint]), []
        return self._in_the_way(scene, states, from_collision) or self._in_between(
            scene, _states(timed, _BETWEEN, until), from_collision)

    def _in_the_way(self, scene: Scene, states: np.ndarray, from_collision: bool) -> Flaw | None:
        exact, group = self.tools.exact, self.query.group
        begin = 0
        if from_collision:  # the motion leads out of the start state's collision
            free = (exact.free(scene, scene.state.with_q(q, self.indices), group) for q in states)
            begin = next((number for number, one in enumerate(free) if one), len(states))
        for first in range(begin, len(states), _AT_ONCE):
            self._raise_if_stopped()
            some = states[first:first + _AT_ONCE]
            blocked = exact.first_blocked(scene, some, group)
            if blocked is not None:
                contacts = exact.contacts(scene, scene.state.with_q(some[blocked], self.indices), group)
                return _named(contacts), contacts
            for q in some if self.query.path_constraints is not None else ():
                violated = self._violated(self.query.path_constraints, scene.state.with_q(q, self.indices), scene)
                if violated:
                    return violated, []
        return None

    def _in_between(self, scene: Scene, states: np.ndarray, from_collision: bool) -> Flaw | None:
        for begin in range(0, len(states), 512):
            self._raise_if_stopped()
            some = states[begin:begin + 512]
            first = first_touching(self.tools.exact, scene, self.group, some)
            if first is not None and not from_collision:
                contacts = self.tools.exact.contacts(scene, scene.state.with_q(some[first], self.indices),
                                                     self.query.group)
                return _named(contacts), contacts
        return None

    # -- time ---------------------------------------------------------------------------------------------------

    def _elapsed(self) -> float:
        return self.tools.clock() - self.begin

    def _used(self) -> float:
        """The used part of the allowed time [s]."""
        return self._elapsed() - self.spared

    def _is_over(self, share: float = 1.0) -> bool:
        """Whether to stop: requested, or this share of the time is over."""
        return self.tools.stop() or self._used() > share * self.query.allowed_time

    def _check_shapes_in_time(self) -> None:
        self._raise_if_stopped()
        if self._elapsed() > max(self.query.allowed_time, MIN_FOR_SCENE_S):
            raise PlanningFailure(Code.TIMED_OUT, "time was over after %.2f s, while the shapes of %d objects were "
                                  "prepared; those that are done are kept, so that another request gets further"
                                  % (self._elapsed(), len(self.query.scene.objects)))

    def _raise_if_stopped(self) -> None:
        if self.tools.stop():
            raise PlanningFailure(Code.PREEMPTED, "planning was stopped after %.2f s" % self._elapsed())


def _states(timed: Timed, step: float, until: float) -> np.ndarray:
    """Postures (m, k) of a Timed up to ``until`` [s], between which no joint moves by more than ``step``."""
    times = timed.spaced(step)
    return timed.sampled(times[times <= until])[0]


def _dense(path: np.ndarray, spacing: float) -> np.ndarray:
    """The path (m, k) with points added, so that no joint moves by more than ``spacing`` between two."""
    pieces = []
    for a, b in itertools.pairwise(path):
        count = max(1, math.ceil(float(np.abs(b - a).max()) / spacing))
        pieces.append(a + (b - a) * np.arange(count)[:, None] / count)
    return np.concatenate([*pieces, path[-1:]])


def _named(contacts: Sequence[Contact]) -> str:
    named = "; ".join(map(str, contacts[:_NAMED]))
    return named + ("; and %d more" % (len(contacts) - _NAMED) if len(contacts) > _NAMED else "")
