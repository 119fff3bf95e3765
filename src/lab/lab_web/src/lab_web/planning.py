# SPDX-License-Identifier: BSD-3-Clause
"""Motions around obstacles for pages: somebody else plans them, the lab plays them, so that they stop as any other
motion does. No ROS.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from joint_trajectory.segment import CUBIC, LINEAR, splines
from lab_web.control import NotInControl
from lab_web.lab import RobotError
from lab_web.motion import MotionError, PageMotion
from lab_web.playback import RecordingPlayback, Tape

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from lab_web.lab import PageLab
    from lab_web.motion import PageJointLimits
    from lab_web.move_group import MoveGroupPlanner
    from lab_web.robot import BaxterTopics
    from lab_web.task_queue import TaskQueue

#: A plan is played from samples so far apart [s].
SAMPLE_S = 0.02
#: A plan is of use while no joint is further from its start than this [rad].
START_RAD = 0.05


class PlanFailed(Exception):
    """There is no plan; ``code``, with "plan_" before it, is a key of the page's texts, or of no text at all."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class PagePlan(NamedTuple):
    """``names`` of k joints; m points: ``times_s`` (m,) [s], ``positions`` (m, k) [rad], ``velocities`` (m, k) [rad/s]
    or None.
    """

    names: list
    times_s: list
    positions: list
    velocities: list | None


def tape_of(plan: PagePlan) -> Tape:
    """The plan as a recording, sampled. Raises PlanFailed where it is none."""
    try:
        times_s, positions = np.array(plan.times_s, float), np.array(plan.positions, float)
        degree = LINEAR if plan.velocities is None else CUBIC
        velocities = np.zeros_like(positions) if plan.velocities is None else np.array(plan.velocities, float)
        if positions.shape != (len(times_s), len(plan.names)) or velocities.shape != positions.shape:
            raise ValueError
    except ValueError:
        raise PlanFailed("invalid", "a plan whose points have other numbers of values than there are joints") from None
    if len(times_s) < 2 or not (np.diff(times_s) > 0.0).all() or not np.isfinite(positions).all():
        raise PlanFailed("invalid", "a plan of %d points whose times do not rise, or that are no numbers"
                         % len(times_s))
    pieces = splines(times_s, positions, velocities, np.zeros_like(positions), np.full(len(times_s), degree))
    samples_s = np.append(np.arange(times_s[0], times_s[-1], SAMPLE_S), times_s[-1])
    numbers = np.clip(np.searchsorted(times_s, samples_s, "right") - 1, 0, len(pieces) - 1)
    powers = (samples_s - times_s[numbers])[:, None] ** np.arange(6)
    rows = np.einsum("ij,ijk->ik", powers, pieces[numbers])
    return Tape(list(plan.names), (samples_s - times_s[0]).tolist(),
                [dict(zip(plan.names, row, strict=True)) for row in rows.tolist()])


class PagePlanning:
    """``planner``: ``plan(targets)`` waits for a PagePlan to ``targets`` {joint: [rad]}, and raises PlanFailed;
    ``cancel()`` ends that, from any thread. ``tasks``: :class:`lab_web.task_queue.TaskQueue` for this alone;
    ``answer(client, operation)``.
    """

    def __init__(self, lab: PageLab, robot: BaxterTopics, planner: MoveGroupPlanner, tasks: TaskQueue,
                 answer: Callable[[int, dict[str, Any]], object]) -> None:
        self._lab = lab
        self._robot = robot
        self._planner = planner
        self._tasks = tasks
        self._answer = answer
        self._wanted = None

    def plan(self, client: int, operation: dict[str, Any]) -> None:
        """An operation "plan" of a page: ``joints`` {name: [rad]}, or the ``name`` of a pose. The arms go there when
        there is a plan. Raises RobotError, MotionError.
        """
        targets = operation.get("joints")
        if targets is None:
            name = operation.get("name")
            targets = self._robot.poses.get(name) if isinstance(name, str) else None
        if not isinstance(targets, dict):
            raise RobotError("a plan needs \"joints\", an object of joints and angles, or the \"name\" of a pose: %s"
                             % ", ".join(self._robot.poses))
        # What no motion could do is refused before anything is planned.
        PageMotion(self._robot.limits).aim(targets, self._robot.measured())
        self.cancel()
        self._wanted = wanted = object()
        self._tasks.add(client, self._plan_and_go, client, dict(targets), wanted)

    def cancel(self) -> None:
        """The robot is stopped, or the page has lost the control: nothing moves when there is a plan."""
        if self._wanted is not None:
            self._wanted = None
            self._planner.cancel()

    def _plan_and_go(self, client: int, targets: dict[str, float], wanted: object) -> None:
        if wanted is not self._wanted:
            return
        self._tell(client, "busy")
        try:
            plan = self._planner.plan(targets)
            tape = tape_of(plan)
            self._lab.start(client, lambda limits, measured: self._played(wanted, limits, tape, measured))
        except PlanFailed as error:
            self._tell(client, error.code, str(error))
        except (MotionError, NotInControl) as error:
            self._tell(client, getattr(error, "code", "refused"), str(error))
        else:
            self._tell(client, "found", seconds=round(tape.duration_s, 1))
        finally:
            if wanted is self._wanted:
                self._wanted = None

    def _played(self, wanted: object, limits: Mapping[str, PageJointLimits], tape: Tape,
                measured: Mapping[str, float]) -> RecordingPlayback:
        # Here the lab lets nobody stop it: what was stopped before does not move now.
        if wanted is not self._wanted:
            raise PlanFailed("preempted", "the planning was stopped")
        for name, angle in tape.rows[0].items():
            if name not in measured or abs(measured[name] - angle) > START_RAD:
                raise MotionError("%s is not where the plan begins, at %.2f rad; plan again" % (name, angle))
        return RecordingPlayback(limits, tape, measured)

    def _tell(self, client: int, why: str, text: str = "", **values: Any) -> None:
        self._answer(client, {"op": "plan", "why": why, "text": text, **values})
