# SPDX-License-Identifier: BSD-3-Clause
"""The functions of MoveIt's panel, without buttons: goal and start, plan, execute, the scene."""
from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.errors import PlanningError
from motion_planning_rviz import interaction, menu
from motion_planning_rviz.client import NoPosture, SceneSnapshot
from motion_planning_rviz.interaction import WHICH, InteractionError

if TYPE_CHECKING:
    from numpy.random import Generator as Random

    from motion_planning.model import PlanningModel, State
    from motion_planning_rviz.client import ActionOutcome, BodyTouch, MoveGroupClient
    from motion_planning_rviz.interaction import Handle
    from motion_planning_rviz.view import View
    from motion_planning_rviz.worker import Worker

#: Number of postures to try for a random valid state.
_TRIES = 200
_NAMED_CONTACTS = 3
#: Distance between a link and a box that is put in front of it [m].
_GAP_M = 0.001


class Panel:
    """The state of the panel; all methods except :meth:`stop` must be called from one thread.

    model: PlanningModel. client: as MoveGroupClient. view: draws; its methods are called with what has changed. worker:
    has ``put(function)``, for work after the end of an action. generator: numpy.random.Generator.
    """

    def __init__(self, model: PlanningModel, client: MoveGroupClient, view: View, worker: Worker,
                 generator: Random) -> None:
        self.model, self.client, self.view, self.worker = model, client, view, worker
        self._generator = generator
        self.groups = interaction.plannable(model)
        if not self.groups:
            raise InteractionError("robot '%s' has no group with joints; its SRDF has to name one" % model.name)
        self.query = interaction.PanelQuery(self.groups[0], model.default_state())
        self.handles = ()
        self.trajectory = None
        self._snapshot = SceneSnapshot({}, [], [], {})
        self._planners = {}
        self._menu_numbers = {}
        self._path_shown = True
        self._lines = {"goal": "", "start": "", "motion": ""}
        self._busy, self._generation = "", 0

    # -- what is shown ------------------------------------------------------------------------------------------

    def begin(self, group: str, speed: float, measured: bool = False) -> None:
        """Set the goal to the robot's present state. Raises PlanningError if move_group does not answer, and with
        ``measured`` if it has not heard where the joints are."""
        snapshot = self._look()
        if measured and not snapshot.is_measured:
            raise PlanningError("it has not heard where the joints are")
        goal = interaction.with_known(self.query.goal, snapshot.values)
        self.query = replace(self.query, goal=goal, speed=speed)
        self.view.scene(snapshot)
        self.select_group(group or self.query.group)

    def select_group(self, name: str) -> None:
        """Plan for another group from now on. Raises InteractionError."""
        if name not in self.groups:
            raise InteractionError("there is no group '%s' to plan for; there are %s" % (name, ", ".join(self.groups)))
        self.query = replace(self.query, group=name, planner="", pipeline="")
        self.handles = interaction.handles_of(self.model, name)
        self.trajectory = None
        self._lines.update(motion="" if self.handles else "group '%s' has no end that could be dragged" % name)
        self.view.group(name, self.handles)
        for which in WHICH:
            self._show(which)
        self._show_menu()

    def refresh(self) -> None:
        """Read the scene again, and check whether the goal is in collision now."""
        self.view.scene(self._look())
        for which in WHICH:
            self._show(which, moved=False)
        self._show_menu()

    def _look(self) -> SceneSnapshot:
        self._snapshot = self.client.snapshot()
        return self._snapshot

    def _show(self, which: str, moved: bool = True, unreached: tuple[Handle, np.ndarray] | None = None,
              reason: str = "") -> None:
        """Draw "goal" or "start". moved: handles follow; unreached: (handle, pose (4, 4)) that could not be reached,
        and the ``reason``."""
        state = self.query.state(which)
        if state is None:
            self._lines[which] = ""
            self.view.clear(which)
            self._say()
            return
        touches = []
        try:
            valid, touches = self.client.validity(self.query.group, state)
            text = "" if valid else self._invalid(state, touches)
        except PlanningError as error:
            text = str(error)
        name = "" if which == "goal" else "start: "
        self._lines[which] = name + "; ".join(filter(None, [reason, text])) if reason or text else ""
        self.view.ghost(which, state, touches, self._snapshot.attached, unreached)
        if moved:
            self.view.place(which, {handle: interaction.pose_of(self.model, state, handle.link)
                                    for handle in self.handles})
        self._say()

    def _invalid(self, state: State, touches: Sequence[BodyTouch]) -> str:
        beyond = ["joint '%s' is at %.4g, beyond %.4g to %.4g" % found for found in self.model.beyond_limits(
            state.q, 1e-6, self.model.group(self.query.group).indices)]
        pairs = list(dict.fromkeys("%s touches %s" % (touch.a, touch.b) for touch in touches))
        more = ["and %d more" % (len(pairs) - _NAMED_CONTACTS)] if len(pairs) > _NAMED_CONTACTS else []
        return ", ".join(beyond + pairs[:_NAMED_CONTACTS] + more) or "not valid, for move_group"

    def complain(self, text: str) -> None:
        """Report that something was not done, and why."""
        self._say(motion=text)

    def _say(self, **lines: str) -> None:
        self._lines.update(lines)
        self.view.say(self._lines["motion"], [self._lines[which] for which in WHICH])

    def _show_menu(self) -> None:
        query, seen = self.query, self._snapshot
        self.view.menu(menu.build(menu.MenuState(
            groups=self.groups, group=query.group, states=tuple(self.model.group(query.group).states),
            planners=self._planners_of(query.group), planner=(query.pipeline, query.planner), speed=query.speed,
            avoid=query.avoid, own_start=query.start is not None, path=self._path_shown,
            objects=tuple(one.id for one in seen.objects) if seen else (),
            attached=tuple(one.object.id for one in seen.attached) if seen else ()), self._menu_numbers))

    def _planners_of(self, group: str) -> tuple[tuple[str, str], ...]:
        if group not in self._planners:
            try:
                self._planners[group] = self.client.planners(group)
            except PlanningError:
                return ()
        return self._planners[group]

    # -- goal and start -----------------------------------------------------------------------------------------

    def drag(self, which: str, handle: Handle, pose: np.ndarray, released: bool = True) -> None:
        """Let the joints follow a handle's link to ``pose`` (4, 4) in the root link.

        released: the handle may move to the link. If no posture reaches the pose, the ghost stays and the reason is
        shown.
        """
        state = self.query.state(which)
        if state is None:
            return
        try:
            found = self.client.posture(handle, pose, state, self.query.avoid)
        except NoPosture as error:
            self._show(which, False, (handle, pose), self._why_unreached(handle, pose, state, error))
            return
        members = self.model.group(handle.group).joints
        moved = interaction.with_known(state, {name: found[name] for name in members if name in found})
        self.query = self.query.with_state(which, moved)
        self._show(which, moved=released)

    def _why_unreached(self, handle: Handle, pose: np.ndarray, state: State, error: NoPosture) -> str:
        reason = interaction.why_unreachable(self.model, handle, pose, state)
        if reason is not None:
            return reason
        return "link '%s' cannot be put there: %s" % (
            handle.link, "every posture that was found is in collision" if self.query.avoid else error.code)

    def set_state(self, which: str, values: Mapping[str, float]) -> None:
        """Set joints of "goal" or "start" to ``values`` {joint: value}. Raises PlanningError."""
        state = self.query.state(which) or self._robot()
        self._set(which, interaction.with_known(state, values))

    def _set(self, which: str, state: State | None) -> None:
        menu_changes = which == "start" and (self.query.start is None) != (state is None)
        self.query = self.query.with_state(which, state)
        self._show(which)
        if menu_changes:
            self._show_menu()

    def _robot(self) -> State:
        return interaction.with_known(self.query.goal, self._look().values)

    def current(self, which: str) -> None:
        """Set the goal to the robot's present state; from now on the start follows the robot."""
        self._set(which, None if which == "start" else self._robot())

    def copy(self, which: str) -> None:
        """The goal becomes the start, or the start gets its own marker, at the goal."""
        other = self.query.state("start" if which == "goal" else "goal")
        self._set(which, other if other is not None else self._robot())

    def named(self, which: str, name: str) -> None:
        """Set the joints of the group as the SRDF's state ``name`` says. Raises InteractionError."""
        state = self.query.state(which) or self._robot()
        self._set(which, interaction.named_state(self.model, state, self.query.group, name))

    def random(self, which: str) -> None:
        """Set a random state that move_group accepts. Raises InteractionError if none is found."""
        state = self.query.state(which) or self._robot()
        for _ in range(_TRIES):
            drawn = interaction.random_state(self.model, state, self.query.group, self._generator)
            if self.client.validity(self.query.group, drawn)[0]:
                self._set(which, drawn)
                return
        raise InteractionError("none of %d random states is valid" % _TRIES)

    # -- settings -----------------------------------------------------------------------------------------------

    def planner(self, pipeline: str, name: str) -> None:
        self.query = replace(self.query, pipeline=pipeline, planner=name)
        self._show_menu()

    def speed(self, share: float) -> None:
        self.query = replace(self.query, speed=share)
        self._show_menu()

    def toggle(self, what: str) -> None:
        if what == "avoid":
            self.query = replace(self.query, avoid=not self.query.avoid)
        else:
            self._path_shown = not self._path_shown
            self.view.show_path(self._path_shown)
        self._show_menu()

    # -- the scene ----------------------------------------------------------------------------------------------

    def add_box(self, handle: Handle, size: float) -> None:
        """Put a cube with sides of ``size`` [m] in front of a handle's link at the goal."""
        taken = {one.id for one in self._snapshot.objects} | {one.object.id for one in self._snapshot.attached}
        name = next(name for name in ("box_%d" % number for number in itertools.count(1)) if name not in taken)
        pose = interaction.pose_of(self.model, self.query.goal, handle.link)
        pose[:3, 3] += (0.5 * size + _GAP_M) * interaction.outwards(self.model, self.query.goal, handle.link)
        self.client.add_box(name, size, pose)
        self.refresh()

    def remove(self, name: str) -> None:
        self.client.remove(name)
        self.refresh()

    def attach(self, handle: Handle, name: str) -> None:
        """Fix an object to a handle's link, as far from it as it is now from the robot's."""
        self.client.attach(name, handle.link, interaction.touch_links(self.model, handle))
        self.refresh()

    def detach(self, name: str) -> None:
        link = next((one.link_name for one in self._snapshot.attached if one.object.id == name), "")
        self.client.detach(name, link)
        self.refresh()

    # -- motions ------------------------------------------------------------------------------------------------

    def plan(self) -> None:
        self._begin("planning", functools.partial(self.client.plan, self.query, False), self._planned)

    def plan_and_execute(self) -> None:
        self._begin("planning and executing", functools.partial(self.client.plan, self.query, True), self._executed)

    def execute(self) -> None:
        if self.trajectory is None:
            raise InteractionError("there is no plan to execute; plan first")
        self._begin("executing", functools.partial(self.client.execute, self.trajectory), self._executed)

    def stop(self) -> None:
        """Stop the present action. May be called from any thread."""
        self.client.stop()
        self.worker.put(self._stopped)

    def _stopped(self) -> None:
        if self._busy:
            self._generation += 1
            self._busy = ""
        self._say(motion="stopped")

    def _begin(self, what: str, send: Callable[[Callable[[ActionOutcome], None]], None],
               ended: Callable[[ActionOutcome], None]) -> None:
        if self._busy:
            raise InteractionError("still %s; stop that first" % self._busy)
        self._busy, generation = what, self._generation
        self._say(motion=what + " ...")
        try:
            send(lambda outcome: self.worker.put(lambda: self._ended(generation, outcome, ended)))
        except PlanningError:
            self._busy = ""
            raise

    def _ended(self, generation: int, outcome: ActionOutcome, ended: Callable[[ActionOutcome], None]) -> None:
        # A result after a stop is ignored.
        if generation == self._generation:
            self._busy = ""
            ended(outcome)

    def _planned(self, outcome: ActionOutcome) -> None:
        self.trajectory = outcome.trajectory if outcome.success else None
        if self.trajectory is None:
            self._say(motion="no plan: " + outcome.text)
            return
        points = self.trajectory.joint_trajectory.points
        seconds = points[-1].time_from_start.to_sec() if points else 0.0
        self._say(motion="planned: %.2f s long, found in %.3f s" % (seconds, outcome.seconds))

    def _executed(self, outcome: ActionOutcome) -> None:
        if outcome.success:
            self.trajectory = None
            self.view.forget_path()
        self._say(motion="executed" if outcome.success else "not executed: " + outcome.text)
