# SPDX-License-Identifier: BSD-3-Clause
"""How arms yield, slow down, float, stop or fall by what they touch and come near to, and what clients suppress."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from baxter_model import SIDES
from baxter_model.description import avoided_balls
from baxter_model.readiness import UNFOLD
from baxter_model.self_collision import BODY
from sim_time.pace import Schedule

from . import avoidance, collision, safety

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable, Mapping

    from arm_kinematics import Chain
    from baxter_sim_hardware.robot import BaxterHardware
    from baxter_sim_hardware.snapshot import JointSnapshot
    from bullet_sim import Model, World
    from urdf_model import Robot

CHECK_RATE_HZ = 100.0  # rate of the checks of contacts and suppressions


def _near(field: avoidance.Field) -> list[str]:
    """Names of the links that one arm is near to; field: `avoidance.Field`."""
    return sorted({*field.near, *field.other, *field.body})


def guards_of(robot: Robot) -> avoidance.Guards:
    """`avoidance.Guards` of an urdf_model.Robot."""
    balls = avoided_balls(robot)
    return avoidance.Guards(tuple(name for name, _, _ in balls),
                            np.array([centre for _, centre, _ in balls]).reshape(-1, 3),
                            np.array([radius for _, _, radius in balls]))


class Guarding:
    """world, model: of bullet_sim; baxter: `robot.BaxterHardware`; chains: {side: Chain}; guards: `avoidance.Guards`;
    feel: function (side, snapshot) -> (torques (7,), wrench (6,)) from outside; is_squeezed: function(side) -> whether
    its cuff is.

    Attributes: `safety`: `arms.safety.Safety`, or None where collisions are only reported; `warn`: function(time_s,
    kind, text) for the log; `held`: {side: names of the links that avoidance holds that arm away from now}.
    """

    def __init__(self, world: World, model: Model, baxter: BaxterHardware, chains: Mapping[str, Chain],
                 guards: avoidance.Guards, feel: Callable[[str, JointSnapshot | safety.Felt],
                                                          tuple[np.ndarray, np.ndarray]],
                 is_squeezed: Callable[[str], bool]) -> None:
        self._world, self._model, self._baxter, self._arms = world, model, baxter, baxter.arms
        self._chains, self._guards = chains, guards
        self.fields: dict[str, avoidance.Field] = dict.fromkeys(SIDES, avoidance.FREE)
        self._feel, self._is_squeezed = feel, is_squeezed
        self.suppressions: dict[str, collision.Suppressions] = {side: collision.Suppressions() for side in SIDES}
        self._watches: dict[str, collision.Held] = {side: collision.Held() for side in SIDES}
        self.held: dict[str, tuple[str, ...]] = dict.fromkeys(SIDES, ())
        self._schedule = Schedule(CHECK_RATE_HZ)
        self.safety: safety.Safety | None = None
        self.warn: Callable[[float, Hashable, str], None] = lambda time_s, kind, text: None

    def forget(self) -> None:
        """The joints were put elsewhere."""
        if self.safety is not None:
            self.safety.forget()

    def reset(self) -> None:
        """The world went back to its start: nothing is suppressed."""
        for suppressions in self.suppressions.values():
            suppressions.reset()

    def update(self, time_s: float, enabled: bool, joints: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """Before a step: let the arms yield, float, stop or fall, depending on contacts, loads, cuffs and messages.

        joints: (position, velocity, effort) of the whole model.
        """
        if self.safety is not None:
            self.safety.load.note(joints)
        if not self._schedule.due(time_s):
            return
        self._find_frames()
        contacts = self._contacts()
        for side, suppressions in self.suppressions.items():
            self._arms.set_yielding(side, bool(contacts and self._touched(contacts, side, time_s)[0]))
            self.fields[side] = self._field(side, time_s)
            self._arms.set_slowing(side, self.fields[side].slowing)
            is_held = self._watches[side].look(time_s, self.fields[side].slowing)
            self.held[side] = tuple(_near(self.fields[side])) if is_held else ()
            if is_held:
                self.warn(time_s, (side, "held"), "%s limb is held by collision avoidance: on its way it comes too "
                          "near to %s. Take another way, or suppress that by limb/%s/%s" % (
                              side, ", ".join(self.held[side]), side, collision.AVOIDANCE))
            self._arms.set_gravity_compensation(side, not suppressions.active(collision.GRAVITY, time_s))
            floats = enabled and self._is_squeezed(side) and not suppressions.active(collision.CUFF, time_s)
            self._arms.set_floating(side, floats)
        if self.safety is not None and (felt := self.safety.felt()) is not None:
            for side in self.suppressions:
                self._stop_if_it_collides(self.safety, side, time_s, felt, enabled)

    def _find_frames(self) -> None:
        """Where the arms are, and with safety also where they are commanded to be: {side: frames of joints} each."""
        postures = [self._baxter.measured.position]
        if self.safety is not None:
            postures.append(self._arms.commanded_position)
        self._frames = [{side: chain.joint_frames(posture[self._arms.joints_of(side)])
                         for side, chain in self._chains.items()} for posture in postures]

    def _stop_if_it_collides(self, effect: safety.Safety, side: str, time_s: float, felt: safety.Felt,
                             enabled: bool) -> None:
        why = safety.reason(*self._feel(side, felt), lambda kind: self.suppressions[side].active(kind, time_s))
        effect.collides[side] = bool(why)
        if why and enabled and not self._arms.floats(side) and not self._baxter.halted(side):
            self._baxter.halt(side, effect.hold_s)
            self.warn(time_s, (side, "collision"), "%s limb stops, a collision: %s. It takes commands again in %g s" % (
                side, why, effect.hold_s))

    def _field(self, side: str, time_s: float) -> avoidance.Field:
        active, rates = self.suppressions[side].active, self._arms.wanted_rates(side)
        if active(collision.AVOIDANCE, time_s):
            return avoidance.FREE
        found = avoidance.FREE
        if not active(collision.BODY_AVOIDANCE, time_s):
            found = avoidance.field(self._guards, *self._frames[0][side], rates)
            if self.safety is not None:
                found = self.safety.around(found, side, self._frames, rates)
        return found if self.safety is None else self.safety.between(found, side, self._frames, rates)

    def too_near(self) -> str:
        """Which arms are in the field around the head, so that a physical robot could not be enabled; "" for none."""
        self._find_frames()
        near = ["the %s arm (%s)" % (side, ", ".join(field.near)) for side in SIDES
                if (field := self._field(side, self._world.time_s)).near]
        if not near:
            return ""
        return "in the field of collision avoidance: %s; unfold the arms by %s, which suppresses it" % (
            " and ".join(near), UNFOLD)

    def _contacts(self) -> list[tuple[str, str]]:
        """[(link, link)] of the robot's own contacts that overlap or press."""
        return [(contact.link_a, contact.link_b) for contact in self._world.contacts(self._model, self._model)
                if contact.distance <= 0.0 or contact.force > 0.0]

    def _touched(self, contacts: Iterable[tuple[str, str]], side: str, time_s: float) -> tuple[list[str], bool]:
        suppressions = self.suppressions[side]
        if suppressions.active(collision.AVOIDANCE, time_s):
            contacts = []
        elif suppressions.active(collision.BODY_AVOIDANCE, time_s):
            contacts = [pair for pair in contacts if BODY not in pair]
        return collision.touched(contacts, side)

    def near(self, side: str, time_s: float) -> tuple[list[str], bool]:
        """(names of the links that one arm touches or is near to, whether the other arm is among them)."""
        links, other_arm = self._touched(self._contacts(), side, time_s)
        field = self.fields[side]
        return sorted({*links, *_near(field)}), other_arm or bool(field.other)

    def collides(self, side: str, time_s: float, snapshot: JointSnapshot) -> bool:
        """Whether one arm is in a collision; snapshot: `snapshot.JointSnapshot`."""
        if self.safety is not None:
            return self.safety.collides[side] or self._baxter.halted(side)
        active = self.suppressions[side].active
        return bool(safety.reason(*self._feel(side, snapshot), lambda kind: active(kind, time_s)))
