# SPDX-License-Identifier: BSD-3-Clause
"""Planners of the Open Motion Planning Library (the ``ompl`` wheel) on a SphereChecker."""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from motion_planning.planners.errors import NoPath
from motion_planning.planners.trees import Path

if TYPE_CHECKING:
    from motion_planning.planners.trees import TreeSearch
    from motion_planning.spheres import SphereChecker

#: Planners that improve the path until their time is over.
ANYTIME = frozenset({"RRTstar", "InformedRRTstar", "BITstar"})
#: {name in an ompl_planning.yaml: class of ompl.geometric}. PRM and PRMstar are not among them: they call the checker
#: from their own threads, and wait for Python's lock forever.
CLASSES = {"RRT": "RRT", "FMT": "FMT", "BFMT": "BFMT", "KPIECE": "KPIECE1", "BKPIECE": "BKPIECE1",
           "LBKPIECE": "LBKPIECE1", **{name: name for name in ANYTIME}}

# The share of the time until the deadline for an anytime planner: shortcuts and exact geometry need the rest.
_SHARE = 0.8
# By rounding, a start or goal may be this far beyond the bounds [rad or m].
_ROUNDING = 1e-5
# Settings whose setter has another name.
_SETTERS = {"delay_collision_checking": "DelayCC", "cache_cc": "CacheCC"}
# Settings that are not the planner's own.
_FOREIGN = {"type", "projection_evaluator", "longest_valid_segment_fraction", "optimization_objective",
            "termination_condition", "enforce_joint_model_state_space", "maximum_waypoint_distance", "interpolate",
            "hybridize", "multi_query_planning_enabled"}


def is_there() -> bool:
    """Whether the wheel can be imported; the first call takes a tenth of a second and 30 MB."""
    try:
        _library()
    except ImportError:
        return False
    return True


class OmplPlanner:
    """A planner by its name in :data:`CLASSES`, called like ``trees.rrt_connect``. Not repeatable: the library's random
    numbers have no seed.

    name: the planner's; remarks: sentences on unknown and invalid settings.
    """

    def __init__(self, name: str, settings: Mapping[str, str] | None = None) -> None:
        """settings: {key: text}, as in an ompl_planning.yaml. Raises ImportError without the wheel."""
        self.name, self._settings = name, {key: value for key, value in (settings or {}).items()
                                            if key not in _FOREIGN}
        self.remarks = self._made(_Space(None, np.zeros((1, 1))))[1]

    def __call__(self, checker: SphereChecker, bounds: np.ndarray, start: np.ndarray, goals: np.ndarray,
                 run: TreeSearch, reach: float | None = None) -> Path:
        """Return a Path from ``start`` (k,) to one of ``goals`` (g, k), free by ``checker``. Raises NoPath."""
        start, goals = np.asarray(start, dtype=float), np.atleast_2d(np.asarray(goals, dtype=float))
        bounds = np.asarray(bounds, dtype=float)
        for goal in goals[np.argsort(np.linalg.norm(goals - start, axis=1), kind="stable")]:
            if checker.edge(start, goal):
                return Path(np.array([start, goal]))
        space = _Space(checker, np.concatenate([bounds, np.column_stack([start, goals.T])], axis=1))
        points = self._solve(space, (start, goals), run)
        if points is None:
            run.check("a path was looked for by %s of the ompl wheel" % self.name)
            raise NoPath("%s of the ompl wheel ended without a path" % self.name)
        return Path(points, space.asked.edges)

    def _made(self, space: _Space) -> tuple[Any, list[str]]:
        """Return (the library's planner, sentences on settings that it refuses)."""
        planner, remarks = getattr(_library()[1], CLASSES[self.name])(space.information), []
        for key, text in self._settings.items():
            method = _SETTERS.get(key, "".join(word.capitalize() for word in key.split("_")))
            if not hasattr(planner, "set" + method):
                remarks.append("planner %s has no setting '%s'" % (self.name, key))
                continue
            try:
                usual = getattr(planner, "get" + method)() if hasattr(planner, "get" + method) else 0.0
                value = _value(text, usual)
                if key == "range" and value <= 0.0:
                    continue  # the planner's own choice
                getattr(planner, "set" + method)(value)
            except (TypeError, ValueError):
                remarks.append("planner %s cannot take '%s' for its setting '%s'" % (self.name, text, key))
        return planner, remarks

    def _solve(self, space: _Space, ends: tuple[np.ndarray, np.ndarray], run: TreeSearch) -> np.ndarray | None:
        base, _ = _library()
        begin = run.clock()
        deadline = begin + _SHARE * (run.deadline - begin) if self.name in ANYTIME else run.deadline
        planner, _ = self._made(space)
        problem = space.problem(*ends)
        planner.setProblemDefinition(problem)
        planner.setup()
        planner.solve(base.PlannerTerminationCondition(lambda: run.stop() or run.clock() >= deadline))
        if not problem.hasExactSolution():
            return None
        states = problem.getSolutionPath().getStates()
        return np.array([ends[0], *([state[i] for i in range(len(ends[0]))] for state in states[1:])])


class _Space:
    """The search space for the library: k joints with a checker."""

    def __init__(self, checker: SphereChecker | None, values: np.ndarray) -> None:
        """values (k, any): the joints' bounds are around them."""
        base, _ = _library()
        self._space = base.RealVectorStateSpace(len(values))
        bounds = base.RealVectorBounds(len(values))
        for i, row in enumerate(values):
            bounds.setLow(i, float(row.min()) - _ROUNDING)
            bounds.setHigh(i, float(row.max()) + _ROUNDING)
        self._space.setBounds(bounds)
        self.information = base.SpaceInformation(self._space)
        # The library keeps a reference to the callback, which must not refer to the library; otherwise neither is ever
        # freed.
        self.asked = _Asked(checker, len(values))
        self.information.setStateValidityChecker(self.asked.is_free)
        self.information.setMotionValidator(_validator_class()(self.information, self.asked.edge_is_free))
        self.information.setup()

    def problem(self, start: np.ndarray, goals: np.ndarray) -> Any:
        base, _ = _library()
        problem = base.ProblemDefinition(self.information)
        problem.addStartState(self._state(start))
        states = base.GoalStates(self.information)
        for goal in goals:
            states.addState(self._state(goal))
        problem.setGoal(states)
        return problem

    def _state(self, values: np.ndarray) -> Any:
        state = self._space.allocState()
        for i, value in enumerate(values):
            state[i] = float(value)
        return state


class _Asked:
    """Callbacks of the library. edges: number of checked edges."""

    def __init__(self, checker: SphereChecker | None, k: int) -> None:
        self._checker, self._k, self.edges = checker, k, 0

    def is_free(self, state: Sequence[float]) -> bool:
        return self._checker is not None and bool(self._checker.valid(self._values(state))[0])

    def edge_is_free(self, a: Sequence[float], b: Sequence[float]) -> bool:
        self.edges += 1
        return self._checker is not None and self._checker.edge(self._values(a), self._values(b))

    def _values(self, state: Sequence[float]) -> np.ndarray:
        return np.array([state[i] for i in range(self._k)], dtype=np.float32)


def _library() -> tuple[ModuleType, ModuleType]:
    from ompl import base, geometric, util  # its import is slow, and most programs do not need it

    util.setLogLevel(util.LogLevel.LOG_NONE)
    return base, geometric


@lru_cache
def _validator_class() -> type:
    class Validator(_library()[0].MotionValidator):
        def __init__(self, information: Any, ask: Callable[[Any, Any], bool]) -> None:
            super().__init__(information)
            self._ask = ask

        def checkMotion(self, a: Any, b: Any, last: Any = None) -> bool:  # noqa: N802  the library's name
            return self._ask(a, b)

    return Validator


def _value(text: str, usual: object) -> Any:
    """The value of a text, with the type of ``usual``. Raises ValueError."""
    if isinstance(usual, bool):
        return {"1": True, "true": True, "0": False, "false": False}.get(str(text).lower(), bool(float(text)))
    return type(usual)(float(text)) if isinstance(usual, int | float) else str(text)
