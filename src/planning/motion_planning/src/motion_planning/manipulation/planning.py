# SPDX-License-Identifier: BSD-3-Clause
"""Tries candidates until one of them passes all stages."""
from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.cartesian import CartesianError, Steps, cartesian_path
from motion_planning.errors import PlanningError
from motion_planning.kinematics import KinematicsFailure, NoIkSolution, ik
from motion_planning.manipulation.tasks import ManipulationStage, PickTask, by_quality, moved
from motion_planning.pipeline import Code, PlanningFailure
from motion_planning.timing import time_path

if TYPE_CHECKING:
    from motion_planning.cartesian import CartesianPath
    from motion_planning.exact import Contact, ExactChecker
    from motion_planning.manipulation.tasks import Candidate, PlaceTask, Translation
    from motion_planning.model import State
    from motion_planning.pipeline import Plan
    from motion_planning.scene import Scene
    from motion_planning.timing import Timed

# Steps of straight motions [m]; greatest cut of a corner [rad or m]; distance of checked states.
_STEP_M, _CORNER, _RESOLUTION = 0.02, 0.001, 0.02
# Greatest further motion of a hand that must come as close as possible [m].
_CLOSEST_M = 1.0
# Number of the arm's postures after which a candidate is rejected: all, and those without collision at the grasp.
_MAX_POSTURES, _MAX_FREE_POSTURES = 40, 6
# Greatest share of the remaining time for one candidate while there are others.
_SHARE = 0.5
# Number of rejected candidates in a sentence.
_NAMED = 8

# Stages in which a candidate can fail, in their order.
REACH, CONTACT, APPROACH, RETREAT, PLAN = "reach", "grasp pose", "approach", "retreat", "plan"
_ORDER = (REACH, CONTACT, APPROACH, RETREAT, PLAN)
_CODES = {REACH: Code.NO_IK_SOLUTION, CONTACT: Code.GOAL_IN_COLLISION, APPROACH: Code.PLANNING_FAILED,
          RETREAT: Code.PLANNING_FAILED}


class Fall(NamedTuple):
    """Why a candidate was rejected: its name, the stage that it reached, the reason, and a :class:`pipeline.Code`."""

    candidate: str
    stage: str
    reason: str
    code: int

    def __str__(self) -> str:
        return "'%s' fails at '%s': %s" % (self.candidate, self.stage, self.reason)


class ManipulationFailure(PlanningFailure):
    """No candidate is valid. falls: a :class:`Fall` for each tried one, in their order."""

    def __init__(self, code: int, text: str, falls: Iterable[Fall] = (), contacts: Iterable[Contact] = ()) -> None:
        super().__init__(code, text, contacts)
        self.falls = list(falls)


@dataclass(frozen=True, eq=False)
class ManipulationTools:
    """The tools of planning. exact: ExactChecker; plan(scene, q (k,), seconds): returns a pipeline.Plan of the group
    from the scene's state to ``q`` or raises PlanningError; clock: function that returns the time [s]; stop(): true
    ends the search; scaling: (velocity, acceleration) 0 < f <= 1 of the straight motions."""

    exact: ExactChecker
    plan: Callable[[Scene, np.ndarray, float], Plan]
    clock: Callable[[], float]
    stop: Callable[[], bool] = field(default=lambda: False)
    scaling: tuple[float, float] = (1.0, 1.0)


class Manipulation(NamedTuple):
    """candidate: the valid Candidate; stages: [ManipulationStage, ...] in their order; falls: of those tried before
    it."""

    candidate: Candidate
    stages: list[ManipulationStage]
    falls: list[Fall]


class _Fallen(Exception):
    def __init__(self, stage: str, reason: str, code: int | None = None) -> None:
        super().__init__(reason)
        self.stage, self.reason = stage, reason
        self.code = _CODES[stage] if code is None else code


def plan_manipulation(task: PickTask | PlaceTask, candidates: Sequence[Candidate], allowed_time: float,
                      tools: ManipulationTools) -> Manipulation:
    """Return a :class:`Manipulation` of the best valid Candidate.

    task: PickTask or PlaceTask; candidates: list; allowed_time [s]. For each candidate, in the order of quality: a
    posture of the arm without collision, the approach, the retreat with the object in the hand or in its place, then a
    path to the start of the approach. Every state is checked by exact geometry. Raises ManipulationFailure if none is
    valid (with the stage at which each failed), if there are none, out of time, or stopped.
    """
    if not candidates:
        raise ManipulationFailure(Code.PLANNING_FAILED, "'%s' cannot be %s: the list of candidates is empty"
                                  % (task.target, task.verb))
    end = tools.clock() + allowed_time
    falls, late = [], False
    ordered = by_quality(candidates)
    for number, candidate in enumerate(ordered):
        left = end - tools.clock()
        late = left <= 0.0
        if late or tools.stop():
            break
        last = number + 1 == len(ordered)
        try:
            return Manipulation(candidate, _Attempt(task, candidate, tools, left if last else _SHARE * left).run(),
                                falls)
        except _Fallen as fallen:
            falls.append(Fall(candidate.name, fallen.stage, fallen.reason, fallen.code))
    if tools.stop():
        raise ManipulationFailure(Code.PREEMPTED, "planning was stopped", falls)
    raise _failure(task, len(candidates), falls, late)


def _failure(task: PickTask | PlaceTask, count: int, falls: list[Fall], late: bool) -> ManipulationFailure:
    told = "; ".join(map(str, falls[:_NAMED]))
    if len(falls) > _NAMED:
        told += "; and %d more" % (len(falls) - _NAMED)
    if late:
        return ManipulationFailure(
            Code.TIMED_OUT, "'%s' cannot be %s: %d of %d candidates were tried in the time allowed%s"
            % (task.target, task.verb, len(falls), count, ": " + told if told else ""), falls)
    furthest = max(falls, key=lambda fall: _ORDER.index(fall.stage))
    return ManipulationFailure(furthest.code, "'%s' cannot be %s, none of %d candidates works: %s"
                               % (task.target, task.verb, count, told), falls)


class _Attempt:
    """One candidate while it is tried."""

    def __init__(self, task: PickTask | PlaceTask, candidate: Candidate, tools: ManipulationTools,
                 seconds: float) -> None:
        self.task, self.candidate, self.tools, self.seconds = task, candidate, tools, seconds
        self.model = task.scene.model
        self.group = self.model.groups[task.group]
        self.begin = tools.clock()
        self.tried = self.free = 0
        self.fallen: _Fallen | None = None

    def run(self) -> list[ManipulationStage]:
        """Return the stages. Raises _Fallen."""
        if isinstance(self.task, PickTask) and self.task.minimize_distance:
            self.candidate = moved(self.candidate, self._closest(self.task))
        scene = self.task.approaching(self.candidate)
        approach, retreat, after = self._straight_ways(scene)
        begin = approach[0]
        try:
            plan = self.tools.plan(self.task.on_the_way(), begin, max(0.05, self._left()))
        except PlanningError as error:
            raise _Fallen(PLAN, str(error), int(getattr(error, "code", Code.PLANNING_FAILED))) from None
        at_begin = scene.state.with_q(begin, self.group.indices)
        stages = [ManipulationStage("plan", plan.timed, {}, self.task.on_the_way())]
        if self.candidate.before:
            stages.append(ManipulationStage("pre_grasp", None, self.candidate.before, scene.with_state(at_begin)))
        stages.append(ManipulationStage("approach", self._timed(approach, scene, APPROACH), {},
                                        scene.with_state(at_begin)))
        stages.append(ManipulationStage("grasp", None, self.candidate.after, after))
        stages.append(ManipulationStage("retreat", self._timed(retreat, after, RETREAT), {}, after))
        return stages

    # -- the grasp ----------------------------------------------------------------------------------

    def _straight_ways(self, scene: Scene) -> tuple[np.ndarray, np.ndarray, Scene]:
        """(approach (m, k), retreat (m, k), scene of the retreat) of the first posture that has both."""
        found: list[tuple[np.ndarray, np.ndarray, Scene]] = []

        def accept(q: np.ndarray) -> str | None:
            try:
                found[:] = [self._ways_through(scene, scene.state.with_q(q))]
            except _Fallen as fallen:
                self._note(fallen)
                return fallen.reason
            return None

        try:
            ik(self.model, self.group, {self.task.link: self.candidate.pose}, scene.state, max(0.0, self._left()),
               accept, self.tools.clock)
        except (NoIkSolution, KinematicsFailure) as error:
            raise self.fallen or _Fallen(REACH, str(error)) from None
        return found[0]

    def _note(self, fallen: _Fallen) -> None:
        """Keep the failure of the latest stage; give up after enough of them."""
        if self.fallen is None or _ORDER.index(fallen.stage) > _ORDER.index(self.fallen.stage):
            self.fallen = fallen
        self.tried += 1
        self.free += fallen.stage != CONTACT
        if self.tried >= _MAX_POSTURES or self.free >= _MAX_FREE_POSTURES or self.tools.stop():
            raise self.fallen

    def _ways_through(self, scene: Scene, state: State) -> tuple[np.ndarray, np.ndarray, Scene]:
        touching = self._contact(scene, state)
        if touching:
            raise _Fallen(CONTACT, touching)
        pose = self.candidate.pose
        approach = self.candidate.approach
        back = self._straight(scene, state, -approach.vector(pose), approach, APPROACH)
        after = self.task.retreating(self.candidate, state)
        # A contact at the grasp is reported as such, and not as a retreat of length 0.
        touching = self._contact(after, after.state)
        if touching:
            raise _Fallen(RETREAT, "at its begin %s" % touching)
        retreat = self.candidate.retreat
        away = self._straight(after, after.state, retreat.vector(pose), retreat, RETREAT)
        return back[::-1], away, after

    def _straight(self, scene: Scene, state: State, direction: np.ndarray, way: Translation, stage: str) -> np.ndarray:
        """Joints (m, k) of the straight motion from ``state``, as far as possible."""
        here = state.q[self.group.indices][None]
        if not way.desired > 0.0:
            return here
        if way.desired < way.least - 1e-9:
            raise _Fallen(stage, "%.3g m are desired and at least %.3g m allowed" % (way.desired, way.least))
        try:
            path = self._line(scene, state, direction * way.desired, _STEP_M)
        except CartesianError as error:
            raise _Fallen(stage, str(error)) from None
        gone = path.fraction * way.desired
        if gone < way.least - 1e-9:
            raise _Fallen(stage, "%.3f of at least %.3f m: %s" % (gone, way.least, path.reason))
        return path.joints

    def _line(self, scene: Scene, state: State, shift: np.ndarray, step: float) -> CartesianPath:
        goal = np.array(self.model.frame_of(state.q, self.task.link, state.base))
        goal[:3, 3] += shift

        def accept(q: np.ndarray) -> str | None:
            return self._contact(scene, state.with_q(q, self.group.indices))

        return cartesian_path(self.model, self.task.group, state, self.task.link, [goal],
                              Steps(step, accept=accept, stop=self.tools.stop))

    def _closest(self, task: PickTask) -> np.ndarray:
        """The pose (4, 4) that the hand can reach from the candidate's pose before it touches something."""
        scene, pose = task.closing_in(self.candidate), self.candidate.pose
        try:
            q = ik(self.model, self.group, {self.task.link: pose}, scene.state, max(0.0, 0.2 * self._left()),
                   lambda q: self._contact(scene, scene.state.with_q(q)), self.tools.clock)
        except (NoIkSolution, KinematicsFailure):
            return pose  # the next check reports the reason
        state = scene.state.with_q(q)
        path = self._line(scene, state, self.candidate.approach.vector(pose) * _CLOSEST_M, 0.2 * _STEP_M)
        return self.model.frame_of(state.with_q(path.joints[-1], self.group.indices).q, self.task.link, state.base)

    # -- checks -------------------------------------------------------------------------------------------------

    def _contact(self, scene: Scene, state: State) -> str | None:
        """None, or the sentence about the contact."""
        if self.tools.exact.free(scene, state, self.task.group):
            return None
        return "; ".join(map(str, self.tools.exact.contacts(scene, state, self.task.group, 3)))

    def _timed(self, path: np.ndarray, scene: Scene, stage: str) -> Timed:
        indices = self.group.indices
        velocity = self.tools.scaling[0] * self.model.velocity[indices]
        acceleration = self.tools.scaling[1] * self.model.acceleration[indices]
        timed = time_path(path, velocity, acceleration, "time_optimal_trajectory_generation", tolerance=_CORNER)
        if len(timed.times) > 1:
            states = timed.sampled(timed.spaced(_RESOLUTION))[0]
            blocked = self.tools.exact.first_blocked(scene, states, self.task.group)
            if blocked is not None:
                state = scene.state.with_q(states[blocked], indices)
                raise _Fallen(stage, "the timed way is not free: %s" % self._contact(scene, state))
        return timed

    def _left(self) -> float:
        return self.seconds - (self.tools.clock() - self.begin)
