# SPDX-License-Identifier: BSD-3-Clause
"""The exercise on planning: an arm, a pillar in its way, and move_group. Free of ROS."""
from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from baxter_model import joint_names, poses
from command_line.options import counted
from rf_checks import measures
from rf_checks.recording import Criterion, RunFault
from rf_checks.tasks import ExerciseTask, ProgramCall, motion_criteria, postures

if TYPE_CHECKING:
    from numpy.random import Generator

    from rf_checks.recording import Box, ProgramRun, RunRecording
    from rf_checks.robot import JudgedRobot

ARM, STATE = "left", "left_neutral"
# The pillar stands on the floor in front of the arm's left half, in `base` [m].
_FLOOR_M, _TOP_M, _WIDTH_M = -0.93, 0.25, 0.12
_PLACE_M, _SPREAD_M = (0.842, 0.53), 0.02
# Where the arm's first joint is before [rad]: on the other side of the pillar.
_BEGIN_RAD, _SPREAD_RAD = -0.9, 0.08
# A box in the scene is right if it reaches so far within the pillar and so far beyond it on each side [m].
WITHIN_M, BEYOND_M = 0.005, 0.06
#: Different boxes that a program may tell move_group of; with more of them it has not said where the pillar stands.
MAX_BOXES = 10
# Edges that are all this share of the true ones are half sizes.
_HALF, _HALF_TOLERANCE = 0.5, 0.05

_URDF = """<robot name="pillar">
  <link name="pillar">
    <inertial><mass value="10"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry>%(box)s</geometry><material name="grey"><color rgba="0.5 0.55 0.6 1"/></material></visual>
    <collision><geometry>%(box)s</geometry></collision>
  </link>
  <gazebo><static>true</static></gazebo>
</robot>
"""


@dataclass(frozen=True)
class Obstacle:
    """A box that stands fast. middle x y z, edges along x y z, in `base` [m]."""

    middle: tuple[float, float, float]
    edges: tuple[float, float, float]

    def urdf(self) -> str:
        """Its description, URDF text."""
        return _URDF % {"box": '<box size="%g %g %g"/>' % self.edges}

    def is_covered(self, pose: np.ndarray, edges: np.ndarray) -> bool:
        """Whether a box with `pose` (4, 4) and `edges` (3,) stands for it: as large, or a little larger."""
        own = np.eye(4)
        own[:3, 3] = self.middle
        return bool(_beyond(own, np.array(self.edges), pose, edges) < WITHIN_M
                    and _beyond(pose, edges, own, np.array(self.edges)) < BEYOND_M)


def _beyond(pose: np.ndarray, edges: np.ndarray, other: np.ndarray, size: np.ndarray) -> float:
    """How far a box with `pose` and `edges` reaches beyond the faces of one with `other` and `size` [m]."""
    corners = 0.5 * edges * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    seen = np.linalg.inv(other) @ pose
    return float((np.abs(corners @ seen[:3, :3].T + seen[:3, 3]) - 0.5 * size).max())


class Way(NamedTuple):
    """Angles to reach (7,) [rad], from s0 to w2, and what is in the way."""

    goal: tuple[float, ...]
    pillar: Obstacle


class PlanAround(ExerciseTask[Way]):
    """`plan_around.py X Y Z LX LY LZ`: the left arm to `left_neutral`, past a pillar at X Y Z with edges LX LY LZ."""

    def calls(self, rng: Generator) -> list[ProgramCall[Way]]:
        x, y = (round(float(value + rng.uniform(-_SPREAD_M, _SPREAD_M)), 3) for value in _PLACE_M)
        edges = _WIDTH_M, _WIDTH_M, round(_TOP_M - _FLOOR_M, 3)
        pillar = Obstacle((x, y, round(0.5 * (_FLOOR_M + _TOP_M), 3)), edges)
        posture = postures(rng, 0.05)
        posture[joint_names(ARM)[0]] = round(float(_BEGIN_RAD + rng.uniform(-_SPREAD_RAD, _SPREAD_RAD)), 4)
        words = tuple("%g" % value for value in (*pillar.middle, *pillar.edges))
        way = Way(tuple(poses().angles("neutral", ARM).values()), pillar)
        return [ProgramCall(words, posture, 60.0, way, 25.0, pillar)]

    def criteria(self, call: ProgramCall[Way], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        recording = run.recording
        share, found = 0.0, "the arm did not move"
        if measures.has_moved(recording.arm(ARM)):
            share, off, found = measures.distance_from_goal(joint_names(ARM), recording.arm(ARM)[-1],
                                                            call.expected.goal)
            share = share if off < measures.OFF_GOAL_RAD else 0.0
        known = self._knows(call.expected.pillar, _told(recording))
        return [Criterion(STATE, share, 40.0, found),
                Criterion("the pillar in the scene", 1.0 if known else 0.0, 20.0,
                          "move_group knew it" if known else "move_group did not know it as it stands"),
                *motion_criteria(run, (ARM,), share, call, (10.0, 20.0, 10.0), 3)]

    @staticmethod
    def _knows(pillar: Obstacle, told: list[Box]) -> bool:
        return len(told) <= MAX_BOXES and any(pillar.is_covered(pose, edges) for _, pose, edges in told)

    def foremost(self, call: ProgramCall[Way], run: ProgramRun) -> RunFault | None:
        return self._about_scene(call, run) if _touched(run.recording) else None

    def slip(self, call: ProgramCall[Way], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        recording = run.recording
        fault = self._about_scene(call, run)
        if fault is None and not recording.accepted_count(ARM) and recording.was_enabled():
            fault = RunFault("not_executed",
                             "no joint command came, though the robot was enabled: plan() only looks for "
                             "a way; go() takes it, or execute() with the second of what plan() returns")
        if fault is None and measures.has_moved(recording.arm(ARM)):
            off = np.abs(recording.arm(ARM)[-1] - np.array(call.expected.goal))
            if off.max() > measures.AT_GOAL_RAD:
                fault = RunFault("far_off", "%s ended %.2f rad from `%s`, a state of the group `%s_arm`: "
                                 "set_named_target(\"%s\") before go()"
                                 % (joint_names(ARM)[int(off.argmax())], off.max(), STATE, ARM, STATE))
        return fault

    @staticmethod
    def _about_scene(call: ProgramCall[Way], run: ProgramRun) -> RunFault | None:
        """A RunFault for what move_group was told of the pillar, or None."""
        pillar, told = call.expected.pillar, _told(run.recording)
        if PlanAround._knows(pillar, told):
            return None
        end = "; the arm ran into it" if _touched(run.recording) else ""
        if len(told) > MAX_BOXES:
            return RunFault("too_many_boxes", "move_group was told of %s%s: one stands there, with the numbers on "
                            "the command line" % (counted(len(told), "box", "boxes"), end))
        if not told:
            return RunFault("no_box", "move_group was told of no box, so it plans as if nothing stood there%s: "
                            "PlanningSceneInterface().add_box(NAME, POSE, SIZE) before you plan" % end)
        name, pose, edges = min(told, key=lambda box: np.linalg.norm(box[1][:3, 3] - np.array(pillar.middle)))
        if np.abs(edges / np.array(pillar.edges) - _HALF).max() < _HALF_TOLERANCE:
            return RunFault("half_size", "`%s` in the planning scene has edges of %s m, half of the pillar's %s%s: "
                            "add_box takes whole edges" % (name, _words(edges), _words(pillar.edges), end))
        off = pose[:3, 3] - np.array(pillar.middle)
        if np.abs(off).max() > BEYOND_M:
            return RunFault("box_elsewhere", "`%s` in the planning scene is %.2f m from where the pillar stands: its "
                            "middle is at %s in `base`, and the pillar's at %s%s. The numbers are for the frame in "
                            "header.frame_id of the pose, and for the middle of the box"
                            % (name, np.linalg.norm(off), _words(pose[:3, 3]), _words(pillar.middle), end))
        return RunFault("box_size",
                        "`%s` in the planning scene has edges of %s m, and the pillar %s%s; at most %g m more "
                        "on each side is a margin" % (name, _words(edges), _words(pillar.edges), end, BEYOND_M))


def _touched(recording: RunRecording) -> bool:
    return any("pillar" in link for pair in recording.contacts() for link in pair)


def _told(recording: RunRecording) -> list[Box]:
    """The different boxes in move_group's scene until the arm came to rest."""
    rows = measures.moving_rows(recording.times, recording.arm(ARM)) if measures.has_moved(recording.arm(ARM)) else None
    last = rows[1] if rows else len(recording.records)
    found = {}
    for row, boxes in recording.scenes():
        if row <= last:
            found.update(((name, pose.tobytes(), edges.tobytes()), (name, pose, edges)) for name, pose, edges in boxes)
    return list(found.values())


def _words(numbers: Iterable[float]) -> str:
    return " ".join("%.2f" % value for value in numbers)
