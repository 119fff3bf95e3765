# SPDX-License-Identifier: BSD-3-Clause
"""Another way for joints that move already, found and timed before they reach what has come into their way."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.constraints import ConstraintSet, JointTarget
from motion_planning.pipeline import Code, Plan, PlanningFailure, checked, plan
from motion_planning.planners import first_touching
from motion_planning.timing import Timed
from motion_planning.timing.joining import brakings, joinings, led

if TYPE_CHECKING:
    from motion_planning.exact import ExactChecker
    from motion_planning.model import Group
    from motion_planning.pipeline import PlanQuery, Tools
    from motion_planning.scene import Scene

# How far ahead of now the new trajectory begins [s]: planning it, and its way to the controller, take most of that.
# The first that leaves room to brake before the obstacle.
_AHEAD_S = (0.12, 0.08, 0.05)
# The same for further searches, where an earlier one had too little time and the obstacle is at least _FAR times as
# far.
_LATER_S, _FAR = (0.4, 1.0), 2.0
_TOO_LITTLE_TIME = (Code.TIMED_OUT, Code.PREEMPTED, Code.PLANNING_FAILED)
# What the way to the controller may take of that [s], and the share of the rest that the search may use.
_SENDING_S, _SEARCHING = 0.02, 0.5
# How far ahead of now joints that are to stop begin to brake [s], and the multiples of their limits of acceleration
# that are tried: what is near is worth a hard stop.
_BRAKING_AHEAD_S, _HARDER = 0.05, (1.0, 2.0, 4.0, 8.0)
# Shares of the time until the obstacle after which joints may still be able to stop, the longest first.
_SHARES = (0.75, 0.5, 0.25, 0.1)
# Distance of checked states [rad or m, in any joint].
_APART = 0.01
# Greatest deviation of goal joints [rad or m].
_AT_GOAL = 1e-4


class Running(NamedTuple):
    """A trajectory under way. timed: of the group's joints; now(): the time on it [s]; blocked_from [s]: the first
    time at which its joints would touch something."""

    timed: Timed
    now: Callable[[], float]
    blocked_from: float


class Redirection(NamedTuple):
    """timed: what to follow from the time ``begin`` [s] of the running trajectory on, where position, velocity and
    acceleration are that one's; its second point is some time behind its first. plan: the Plan of the new way, which
    begins where the old motion would have come to rest. overlap [s]: how long the joints follow both; 0: they stop
    for an instant."""

    timed: Timed
    begin: float
    plan: Plan
    overlap: float


class Stop(NamedTuple):
    """timed: what to follow from the time ``begin`` [s] of the running trajectory on, where position, velocity and
    acceleration are that one's, until the joints rest; its second point is some time behind its first. harder: the
    multiple of the joints' limits of acceleration that it keeps to, 1 where there is room."""

    timed: Timed
    begin: float
    harder: float


def stopped(exact: ExactChecker, scene: Scene, group: Group, running: Running) -> Stop | None:
    """Return a Stop of a Group's joints, which follow a :class:`Running` trajectory in a scene: the gentlest one that
    touches nothing. None if all of those that are tried touch something: whatever stops them at once has to."""
    limit = scene.model.acceleration[group.indices]
    for harder in _HARDER:
        found = _at_rest(exact, scene, group, running, running.now() + _BRAKING_AHEAD_S, harder * limit)
        if found is not None:
            return Stop(led(found[1]), found[0], harder)
    return None


def last_stop(exact: ExactChecker, scene: Scene, group: Group, running: Running) -> float:
    """Return until when a search may last: the latest of some times on a :class:`Running` trajectory [s] at which
    :func:`stopped` still finds a way to rest within the joints' limits of acceleration; now, if there is none."""
    now, limit = running.now(), scene.model.acceleration[group.indices]
    for share in _SHARES:
        until = now + share * (running.blocked_from - now)
        if _at_rest(exact, scene, group, running, until + _BRAKING_AHEAD_S, limit) is not None:
            return until
    return now


def redirected(query: PlanQuery, tools: Tools, running: Running) -> Redirection:
    """Return a Redirection for a :class:`Running` trajectory, in the scene of a PlanQuery.

    The joints of ``query.scene`` count for what the group does not move. The goal is where the running trajectory ends
    if that is free, else the query's goals. What is far is worth a longer search, if a short one finds nothing. Raises
    PlanningFailure if there is no other way, if it is not found in time, or if the joints cannot come to rest before
    the obstacle; they have to be stopped then.
    """
    try:
        return _redirected(query, tools, running, _AHEAD_S)
    except PlanningFailure as error:
        failure = error
    for ahead in _LATER_S:
        far = running.blocked_from - running.now() >= _FAR * ahead
        if failure.code not in _TOO_LITTLE_TIME or not far or tools.stop():
            break
        try:
            return _redirected(query, tools, running, (ahead,))
        except PlanningFailure as error:
            failure = error
    raise failure


def _redirected(query: PlanQuery, tools: Tools, running: Running, choices: Sequence[float]) -> Redirection:
    """The same, of one search that begins at one of the times ahead of now [s]."""
    begin = running.now()
    start, braking = _brake(query, tools, running, choices)
    # Both on the trajectory's time, which may run faster or slower than the clock.
    end = start - _SENDING_S
    searched = begin + _SEARCHING * (end - begin)
    group = query.scene.model.groups[query.group]
    scene = query.scene.with_state(query.scene.state.with_q(braking.positions[-1], group.indices))
    again = replace(query, scene=scene, goals=_goals(query, tools, running, scene), attempts=1,
                    allowed_time=max(1e-3, searched - running.now()))
    found = plan(again, replace(tools, stop=lambda: tools.stop() or running.now() > searched))
    joining = replace(tools, stop=lambda: tools.stop() or running.now() > end)
    velocity = np.maximum(scene.model.velocity[group.indices] * query.velocity_scaling,
                          np.abs(running.timed.sampled([start])[1][0]))
    for overlap, timed in joinings(braking, found.timed, velocity, scene.model.acceleration[group.indices]):
        flaw = checked(again, joining, timed, braking.duration + 1e-6)
        if running.now() > end:
            raise PlanningFailure(Code.TIMED_OUT, "another way was found too late, after %.3f s"
                                  % (running.now() - begin))
        if flaw is None:
            return Redirection(timed, start, found, overlap)
    raise PlanningFailure(Code.INVALID_MOTION_PLAN, "the joints cannot leave their way: %s" % flaw[0], flaw[1])


def _brake(query: PlanQuery, tools: Tools, running: Running, choices: Sequence[float]) -> tuple[float, Timed]:
    """(time on the running trajectory, Timed that comes to rest from there without touching anything)."""
    group = query.scene.model.groups[query.group]
    acceleration = query.scene.model.acceleration[group.indices]
    now = running.now()
    for ahead in choices:
        found = _at_rest(tools.exact, query.scene, group, running, now + ahead, acceleration)
        if found is not None:
            return found
    raise PlanningFailure(Code.INVALID_MOTION_PLAN, "the joints cannot come to rest in time: something stands %.2f s "
                          "ahead" % (running.blocked_from - now))


def _at_rest(exact: ExactChecker, scene: Scene, group: Group, running: Running, start: float,
             acceleration: np.ndarray) -> tuple[float, Timed] | None:
    """(``start`` or the end of the running trajectory [s], Timed that comes to rest from there within the limits
    acceleration (k,) without touching anything), or None."""
    start = min(start, running.timed.duration)
    if start >= running.blocked_from:
        return None
    for found in brakings(running.timed, start, acceleration):
        if first_touching(exact, scene, group, found.sampled(found.spaced(_APART))[0]) is None:
            return start, found
    return None


def _goals(query: PlanQuery, tools: Tools, running: Running, scene: Scene) -> list[ConstraintSet]:
    group = query.scene.model.groups[query.group]
    end = running.timed.positions[-1]
    if not tools.exact.free(scene, scene.state.with_q(end, group.indices), query.group):
        return query.goals
    return [ConstraintSet(joints=tuple(JointTarget(name, value, _AT_GOAL, _AT_GOAL)
                                       for name, value in zip(group.joints, end.tolist(), strict=True)))]
