# SPDX-License-Identifier: BSD-3-Clause
"""The exercise on steering: a hand brought to a place by twists for a servo. Free of ROS."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rf_checks import measures
from rf_checks.measures import ramp
from rf_checks.recording import Criterion, RunFault
from rf_checks.tasks import OFF_M, OFF_RAD, ExerciseTask, ProgramCall, motion_criteria, postures

if TYPE_CHECKING:
    from numpy.random import Generator

    from rf_checks.recording import ProgramRun, RunRecording
    from rf_checks.robot import JudgedRobot

ARM, SERVO = "left", "/left_servo"
TWISTS = SERVO + "/delta_twist_cmds"
# Where goals lie in `base` [m]: in front of the arm, where it can have the orientation that it has in neutral. One is
# on the left and high, the other on the right and low.
_MIDDLE_M, _APART_M, _SPREAD_M = (0.68, 0.55, 0.15), (0.0, 0.12, 0.08), 0.03


class SteerTo(ExerciseTask[tuple[float, ...]]):
    """`steer_to.py X Y Z`: the left gripper to a place in `base` by twists, with the orientation that it has."""

    def calls(self, rng: Generator) -> list[ProgramCall[tuple[float, ...]]]:
        goals = [np.array(_MIDDLE_M) + side * np.array(_APART_M) + rng.uniform(-_SPREAD_M, _SPREAD_M, 3)
                 for side in (1.0, -1.0)]
        return [ProgramCall(tuple("%.3f" % value for value in goal), postures(rng, 0.05), 40.0,
                            tuple(round(float(value), 3) for value in goal), 12.0, steered=True) for goal in goals]

    def criteria(self, call: ProgramCall[tuple[float, ...]], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        recording = run.recording
        position = kept = 0.0
        reached = turned = "the arm did not move"
        if measures.has_moved(recording.arm(ARM)):
            distance, angle = _errors(call, recording, robot)
            position = ramp(distance, *OFF_M)
            kept = position * ramp(angle, *OFF_RAD)
            reached = "%.1f cm off" % (100 * distance) if position < 1.0 else "within %g cm" % (100 * OFF_M[0])
            turned = "%.0f degrees off" % math.degrees(angle) if angle > OFF_RAD[0] else "kept"
        others = _other_commanders(recording)
        return [Criterion("position", position, 40.0, reached), Criterion("orientation", kept, 20.0, turned),
                Criterion("steered", 0.0 if others else position, 10.0, "also moved by %s" % others[0] if others else
                          "by twists alone" if position else reached),
                *motion_criteria(run, (ARM,), min(position, kept), call, (10.0, 10.0, 10.0), 1)]

    def slip(self, call: ProgramCall[tuple[float, ...]], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        recording = run.recording
        if others := _other_commanders(recording):
            return RunFault("not_steered",
                            "%s moved the arm by joint commands: steer it by geometry_msgs/TwistStamped on "
                            "%s, and leave the joints to the servo" % (others[0], TWISTS))
        if not recording.accepted_count(ARM):
            return RunFault("no_twist", "no twist moved the arm, though the robot was enabled: publish geometry_msgs/"
                            "TwistStamped on %s again and again, with header.stamp = rospy.Time.now(): each counts for "
                            "0.1 s" % TWISTS) if recording.was_enabled() else None
        if not measures.has_moved(recording.arm(ARM)):
            return RunFault("small_twist",
                            "the twists were so small that the arm hardly moved: they are in m/s and rad/s")
        distance, angle = _errors(call, recording, robot)
        if distance > OFF_M[0]:
            first = np.linalg.norm(robot.gripper(ARM, recording, 0)[:3, 3] - np.array(call.expected))
            hint = ("it went away from its goal: are the twists in the axes of header.frame_id, and the goal minus the "
                    "place of the gripper?" if distance > first else
                    "steer until /robot/limb/left/endpoint_state says that it is there")
            return RunFault("far_off", "the gripper ended %.1f cm from its goal: %s" % (100 * distance, hint))
        if angle > OFF_RAD[0]:
            return RunFault("turned",
                            "the gripper has turned by %.0f degrees: twist.angular keeps it as it is with zeros"
                            % math.degrees(angle))
        return None


def _errors(call: ProgramCall[tuple[float, ...]], recording: RunRecording, robot: JudgedRobot) -> tuple[float, float]:
    """How far the gripper is from its goal [m], and from the orientation that it began with [rad]."""
    goal = robot.gripper(ARM, recording, 0)
    goal[:3, 3] = call.expected
    return measures.pose_error(robot.gripper(ARM, recording), goal)


def _other_commanders(recording: RunRecording) -> list[str]:
    """Names of nodes but the servo that moved the arm by joint commands."""
    return sorted({node for node, side, _ in recording.commanders() if side == ARM and node != SERVO})
