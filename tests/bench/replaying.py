# SPDX-License-Identifier: BSD-3-Clause
"""A recording's set-points through the robot's own topics and the physics, in this process, in lock-step.

A recording that begins in motion begins so here: the joints have the angles and speeds of the line nearest to its first
rows, and the set-points of LEAD_S before are the line nearest to the first commands. What the springs and the
integrals had from before is not known, so such a recording is judged from SETTLED_S on.
"""
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rospkg
from recording import JOINT_NAMES, Recording
from robot_bench import load_lab

import xacro
from baxter_model import JOINTS, SIDES, is_part_of_arm
from baxter_sysid.recording import start_of
from baxter_sysid.replay import ReplayedMotion
from urdf_model import Robot, parse_urdf

LEAD_S, SETTLED_S = 0.1, 0.5
RAW_POSITION = 4


class Replayed(NamedTuple):
    """motion: of the recording's rows, for its 14 joints; events: {joint: [(time [s], what)]}, what holds its arm, and
    what that touches."""

    motion: ReplayedMotion
    events: dict[str, list[tuple[float, str]]]


class Start(NamedTuple):
    """position, velocity (14,) [rad, rad/s] at the first row; pace (14,) [rad/s] of the first commands; moves: whether
    the recording begins in motion."""

    position: np.ndarray
    velocity: np.ndarray
    pace: np.ndarray
    moves: bool

    @classmethod
    def of(cls, recording: Recording) -> Start:
        position, velocity = start_of(recording.sensed, recording.period_s)
        pace = start_of(recording.commanded, recording.period_s)[1]
        return cls(position, velocity, pace, bool(velocity.any() or pace.any()))

    @property
    def judged_from_s(self) -> float:
        """How long after its first row the recording counts."""
        return SETTLED_S if self.moves else 0.0

    def sentence(self) -> str:
        """From which second on the recording is judged, and why."""
        if not self.moves:
            return "it begins at rest: judged from its first row on"
        fastest = int(np.argmax(np.abs(self.velocity)))
        return "it begins in motion (%s at %.2f rad/s): judged from %.1f s after its first row on" % (
            JOINT_NAMES[fastest], self.velocity[fastest], SETTLED_S)


def bare_robot() -> Robot:
    """Baxter without grippers."""
    file = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf/baxter.urdf.xacro"
    text = xacro.process_file(str(file), mappings={"%s_gripper" % side: "none" for side in SIDES}).toxml()
    return parse_urdf(text, source=str(file))


def replay(recording: Recording, effects: str, robot: Robot, meshes: bool = False,
           change: Callable[[Any], None] = lambda baxter: None) -> Replayed:
    """The recording on a robot with these effects; meshes: whether its body can touch things; change: called with the
    `robot.Baxter` before."""
    start, period = Start.of(recording), recording.period_s
    lead = round(LEAD_S / period) if start.moves else 0
    ahead = period * np.arange(-lead, 0)[:, None]
    commands = np.concatenate([recording.commanded[0] + ahead * start.pace, recording.commanded])
    lab = load_lab()(robot, parameters={"enable": True, "effects": effects, "joint_state_rate": 500},
                     angles=start.position - LEAD_S * start.velocity * start.moves, meshes=meshes)
    try:
        for publisher in lab.publishers.values():
            publisher.has_listeners = False
        change(lab.plugin._baxter)
        watch = _Watch(lab)
        lab.run(period)
        if start.moves:
            lab.model.set_joint_positions(lab.arm, start.position - LEAD_S * start.velocity, start.velocity)
            lab.plugin._simulated.put_elsewhere()
        for number, commanded in enumerate(commands):
            watch.note(recording.time_s[0] + period * (number - lead))
            lab.command(RAW_POSITION, commanded)
            lab.run(period, after=watch.look)
        return watch.replayed(lead)
    finally:
        lab.close()


class _Watch:
    def __init__(self, lab: Any) -> None:
        self._lab, self._simulated = lab, lab.plugin._simulated
        self._rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._bounded = np.zeros(len(JOINT_NAMES), dtype=bool)
        self._events: dict[str, list[tuple[float, str]]] = {name: [] for name in JOINT_NAMES}

    def look(self, lab: Any) -> None:
        """After a tick."""
        baxter = self._simulated.baxter
        if baxter.actuators is not None:
            known = baxter.measured.gravity + baxter.actuators.known_counterbalance(baxter.measured.position)
            self._bounded |= np.abs(baxter.actuators.added + known) > baxter.actuators.limit

    def note(self, time_s: float) -> None:
        """At a row of the recording."""
        snapshot = self._simulated.snapshot()
        self._rows.append((snapshot.sensed[0][self._lab.arm], self._bounded, snapshot.sensed[2][self._lab.arm]))
        self._bounded = np.zeros(len(JOINT_NAMES), dtype=bool)
        touched = [contact for contact in self._lab.world.contacts(self._lab.model) if contact.force > 0.0]
        for side in SIDES:
            said = []
            if self._simulated.baxter.halted(side):
                said.append("the arm stands after a collision")
            if self._simulated.guarding.held[side]:
                said.append("held by avoidance of %s" % ", ".join(self._simulated.guarding.held[side]))
            links = {link for contact in touched for link in (contact.link_a, contact.link_b)
                     if link is not None and is_part_of_arm(link, side)}
            if links:
                said.append("in contact: %s" % ", ".join(sorted(links)))
            for joint in JOINTS:
                self._events["%s_%s" % (side, joint)] += [(time_s, what) for what in said]

    def replayed(self, lead: int) -> Replayed:
        position, bounded, effort = (np.array(each)[lead:] for each in zip(*self._rows, strict=True))
        return Replayed(ReplayedMotion(position, bounded.astype(float), effort), self._events)
