# SPDX-License-Identifier: BSD-3-Clause
"""Sequences of commands, with rounded corners on request."""
from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import NoSolution
from motion_planning.errors import PlanningError
from motion_planning.industrial.blend import Blend
from motion_planning.industrial.commands import check, failing, in_time, motion
from motion_planning.pipeline import Code, Plan, PlanningFailure
from motion_planning.timing import Timed

if TYPE_CHECKING:
    from motion_planning.industrial.commands import IndustrialCommand, IndustrialMotion
    from motion_planning.industrial.limits import CartesianLimits
    from motion_planning.industrial.profile import Profile
    from motion_planning.pipeline import Tools

# Rounds of slowing down the commands on both sides of a corner until it respects the limits, and margin of each round.
_ROUNDS, _MORE = 8, 1.005
# Points of a trajectory closer than this in time [s] are merged.
_SAME_S = 5e-3


@dataclass
class SequencePiece:
    """A IndustrialMotion in time. begin [s]: in its trajectory; blend: the Blend that it begins with, or None."""

    way: IndustrialMotion
    timed: Timed
    profile: Profile
    begin: float = 0.0
    blend: Blend | None = None


def plan_sequence(commands: Sequence[IndustrialCommand], radii: Iterable[float], tools: Tools,
                  limits: CartesianLimits) -> list[tuple[str, Plan]]:
    """Return [(group name, pipeline.Plan), ...] of :class:`IndustrialCommand`\\ s that follow each other. The first
    starts at its scene's state, each other at the end of the previous one; their start states are ignored. radii (n,)
    [m]: distance from a goal at which the link may leave its path for the next one; 0: it stops at the goal.
    Consecutive commands of one group make one trajectory; the groups' trajectories are to be executed in the order
    given. Corners between two groups are not rounded. In a corner of two LIN or CIRC the rotation is blended in step
    with the position. If a corner would exceed a limit, the commands on both sides of it take longer. tools:
    pipeline.Tools; limits: CartesianLimits. Raises PlanningFailure.
    """
    begin = tools.clock()
    radii = [float(radius) for radius in radii]
    _understand(commands, radii)
    if not commands:
        return []
    ways, state = [], commands[0].query.scene.state
    for number, command in enumerate(commands):
        try:
            command = replace(command, query=replace(command.query, scene=command.query.scene.with_state(state)),
                              start_velocities=command.start_velocities if number == 0 else ())
            way = motion(command, tools, limits)
            ways.append(way)
        except PlanningError as error:
            raise failing(error, number + 1, len(commands)) from None
        state = state.with_q(way.end, way.group.indices)
    plans, first = [], 0
    for group, run in groupby(ways, key=lambda way: way.command.query.group):
        run = list(run)
        here = radii[first:first + len(run) - 1]
        try:
            timed = _Run(run, here, first, len(ways), limits).joined()
            for way in run:
                check(run[0].scene, way.command.query, timed, tools)
                if way.command.query.path_constraints is None:
                    break
        except NoSolution as error:
            raise PlanningFailure(Code.NO_IK_SOLUTION, "a corner cannot be rounded: %s" % error) from None
        plans.append((group, Plan(run[0].scene.state, timed.positions, timed, tools.clock() - begin)))
        first += len(run)
    return plans


def _understand(commands: Sequence[IndustrialCommand], radii: list[float]) -> None:
    negative = [number for number, radius in enumerate(radii) if not 0.0 <= radius < np.inf]
    if negative:
        raise PlanningFailure(Code.INVALID_MOTION_PLAN, "blend_radius of command %d is %g; expected 0 or more"
                              % (negative[0] + 1, radii[negative[0]]))
    if radii and radii[-1] > 0.0:
        raise PlanningFailure(Code.INVALID_MOTION_PLAN, "blend_radius of the last command is %g; nothing follows that "
                              "it could pass over to; expected 0" % radii[-1])


class _Run:
    """Commands of one group that make one trajectory. first: number of commands of the sequence before them."""

    def __init__(self, ways: list[IndustrialMotion], radii: list[float], first: int, total: int,
                 limits: CartesianLimits) -> None:
        self._ways, self._radii, self._first, self._total, self._limits = ways, radii, first, total, limits
        self._stretch = np.ones(len(ways))
        for number, radius in enumerate(radii):
            if radius > 0.0 and (ways[number].follower is None or ways[number + 1].follower is None):
                raise self._failure(number, "group '%s' is not a chain; give a link's pose as goal, or blend_radius 0"
                                    % ways[number].command.query.group)
        for number, (one, other) in enumerate(pairwise(radii)):
            apart = np.linalg.norm(self._corner(number) - self._corner(number + 1))
            if one > 0.0 and other > 0.0 and one + other > apart:
                raise self._failure(number + 1, "the blend radii %g and %g m overlap: the goals of commands %d and %d "
                                    "are %.4f m apart" % (one, other, first + number + 1, first + number + 2, apart))
        # (fraction of the incoming path at the corner's start, of the outgoing path at its end), None without a corner.
        self._cuts = [self._cut(number, radius) if radius > 0.0 else None for number, radius in enumerate(radii)]

    def joined(self) -> Timed:
        """Return the whole as Timed. Raises PlanningFailure, NoSolution."""
        for _ in range(_ROUNDS):
            pieces = self._pieces()
            excesses = [piece.blend.excess(self._limits) if piece.blend else 1.0 for piece in pieces]
            if max(excesses) <= 1.0:
                return _points(pieces)
            for number, excess in enumerate(excesses):
                if excess > 1.0:
                    self._stretch[number - 1:number + 1] *= excess * _MORE
        number = int(np.argmax(excesses))
        raise self._failure(number - 1, "the corner exceeds limits %.2f times however slow; make the blend radius "
                            "larger" % max(excesses))

    def _pieces(self) -> list[SequencePiece]:
        pieces = []
        for number, way in enumerate(self._ways):
            before = self._cuts[number - 1] if number else None
            after = self._cuts[number] if number < len(self._cuts) else None
            limits = _limits(way.limits, before[1] if before else 0.0, 1.0 - after[0] if after else 0.0)
            try:
                timed, profile, self._stretch[number] = in_time(way, limits, self._stretch[number])
            except PlanningFailure as error:
                raise failing(error, self._first + number + 1, self._total) from None
            piece = SequencePiece(way, timed, profile)
            if pieces:
                self._append(number, pieces[-1], piece)
            pieces.append(piece)
        return pieces

    def _append(self, number: int, last: SequencePiece, piece: SequencePiece) -> None:
        """Place ``piece`` in time after ``last``, with a Blend if the corner is rounded."""
        piece.begin = last.begin + last.timed.duration
        cut = self._cuts[number - 1]
        if cut is None:
            return
        overlap = min(last.timed.duration - last.profile.time_at(cut[0]), piece.profile.time_at(cut[1]),
                      last.profile.slowing_down, piece.profile.speeding_up)
        piece.begin -= overlap
        if last.blend and piece.begin < last.begin + last.blend.overlap:
            raise self._failure(number - 1, "the corners at both of its ends overlap; make the blend radii smaller")
        piece.blend = Blend(last, piece, overlap)

    def _cut(self, number: int, radius: float) -> tuple[float, float]:
        one, other = self._ways[number], self._ways[number + 1]
        corner = self._corner(number)
        for way, fraction, what in ((one, 0.0, "start"), (other, 1.0, "goal")):
            away = np.linalg.norm(way.pose(fraction)[:3, 3] - corner)
            if away <= radius:
                raise self._failure(number + (way is other), "its %s is %.4f m from the corner, within the blend "
                                    "radius of %g m" % (what, away, radius))
        return (1.0 - _crossing(lambda u: one.pose(1.0 - u), corner, radius), _crossing(other.pose, corner, radius))

    def _corner(self, number: int) -> np.ndarray:
        return self._ways[number].pose(1.0)[:3, 3]

    def _failure(self, number: int, text: str) -> PlanningError:
        return failing(PlanningFailure(Code.INVALID_MOTION_PLAN, text), self._first + number + 1, self._total)


def _limits(limits: tuple[float, float, float], first: float, last: float) -> tuple[float, float, float]:
    """Velocity, acceleration and deceleration of the fraction of a path, of which the shares ``first`` and ``last`` are
    within the spheres around corners, 0 for no corner. The speed changes over these whole shares, so that the corner is
    as round as possible.
    """
    velocity, acceleration, deceleration = limits
    top = min(velocity**2, 2.0 * acceleration * (first or 1.0 - last), 2.0 * deceleration * (last or 1.0 - first))
    return (np.sqrt(top) if first or last else velocity, top / (2.0 * first) if first else acceleration,
            top / (2.0 * last) if last else deceleration)


def _crossing(pose: Callable[[float], np.ndarray], corner: np.ndarray, radius: float) -> float:
    """The first fraction at which ``pose(fraction)``, beginning in the corner, is ``radius`` away from it."""
    low, high = 0.0, 1.0
    for u in np.linspace(0.0, 1.0, 201)[1:]:
        if np.linalg.norm(pose(u)[:3, 3] - corner) >= radius:
            high = u
            break
        low = u
    for _ in range(40):
        middle = 0.5 * (low + high)
        if np.linalg.norm(pose(middle)[:3, 3] - corner) < radius:
            low = middle
        else:
            high = middle
    return high


def _points(pieces: list[SequencePiece]) -> Timed:
    """One Timed of all pieces."""
    rows = []
    for piece, following in zip(pieces, [*pieces[1:], None], strict=True):
        begin = piece.blend.overlap if piece.blend else 0.0
        end = following.begin - piece.begin if following else np.inf
        if piece.blend:
            rows.append((piece.begin + piece.blend.times, *piece.blend.motion))
        timed = piece.timed
        kept = (timed.times > begin + _SAME_S) & (timed.times < end - _SAME_S)
        if piece.blend is None:
            kept[0] = True  # where the previous one has come to rest
        if following is None:
            kept[-1] = True
        rows.append((piece.begin + timed.times[kept], timed.positions[kept], timed.velocities[kept],
                     timed.accelerations[kept]))
    times, *motion = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    kept = np.concatenate([[True], np.diff(times) > 1e-6])
    return Timed(times[kept], *(part[kept] for part in motion))
