# SPDX-License-Identifier: BSD-3-Clause
"""Grading of each kind of exercise: its criteria, and its typical mistakes. Free of ROS."""
from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from baxter_model import SIDES, joint_names, poses
from command_line.options import counted
from rf_checks import measures, mistakes
from rf_checks.measures import ramp
from rf_checks.recording import Criterion, RunFault

if TYPE_CHECKING:
    from numpy.random import Generator

    from rf_checks.recording import ProgramRun, RunRecording
    from rf_checks.robot import JudgedRobot
    from rf_checks.tasks_planning import Obstacle

# The lab's pose of the left gripper in `base`.
LAB_POINT = (0.644, 0.0, 0.066)
LAB_QUATERNION = (-0.381, 0.923, -0.015, 0.052)
# Up to the first a gripper's place, or its orientation, gets all points, from the second on none [m], [rad].
OFF_M, OFF_RAD = (0.01, 0.1), (math.radians(2), math.radians(30))
# A wave must have 5 cm and three periods; the window of the sine fit loses a part of both.
AMPLITUDE_M, PERIODS = 0.045, 2.5

Expected = TypeVar("Expected")


@dataclass(frozen=True)
class ProgramCall(Generic[Expected]):
    """One run of the program: its arguments, the arms' posture before {joint: rad}, the time limit [sim s], and the
    right answer.

    obstacle: Obstacle in a lab that has move_group, or None. steered: whether the lab has a servo of the left arm.
    """

    arguments: tuple[str, ...]
    posture: dict[str, float]
    limit_s: float
    expected: Expected
    lasts_s: float = 0.0
    obstacle: Obstacle | None = None
    steered: bool = False


class ExerciseTask(ABC, Generic[Expected]):
    """The grading of one kind of exercise."""

    @abstractmethod
    def calls(self, rng: Generator) -> list[ProgramCall[Expected]]:
        """The runs of the check."""

    @abstractmethod
    def criteria(self, call: ProgramCall[Expected], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        """The grades of one run."""

    @abstractmethod
    def slip(self, call: ProgramCall[Expected], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        """The mistake that one run shows, or None."""

    def is_satisfied(self, call: ProgramCall[Expected], run: ProgramRun) -> bool:
        """Whether the judge has seen enough of a program that does not end."""
        return False

    def foremost(self, call: ProgramCall[Expected], run: ProgramRun) -> RunFault | None:
        """A RunFault that explains how the program behaved, or None."""
        return None


def postures(rng: Generator, spread: float = 0.12) -> dict[str, float]:
    """Postures of both arms near neutral, each joint within `spread` [rad]."""
    return {name: round(float(angle + rng.uniform(-spread, spread)), 4)
            for side in SIDES for name, angle in poses().angles("neutral", side).items()}


def pose_matrix(point: Sequence[float], quaternion_xyzw: Iterable[float]) -> np.ndarray:
    """(4, 4) of a position [m] and a quaternion x y z w of any length."""
    matrix = np.eye(4)
    x, y, z, w = quaternion_xyzw
    matrix[:3, :3], matrix[:3, 3] = mistakes.rotation_of(w, x, y, z), point
    return matrix


def motion_criteria(run: ProgramRun, sides: tuple[str, ...], done_share: float, call: ProgramCall[Expected],
                    weights: tuple[float, float, float], halts_allowed: int) -> list[Criterion]:
    """Smoothness, collisions, time: weighted by the solved share of the task (`done_share`)."""
    smooth, clear, quick = weights
    recording = run.recording
    stops = max(measures.halts(recording.times, recording.arm(side)) for side in sides) if len(recording.times) else 0
    touched = recording.contacts()
    lasted = _duration(recording)
    text = "; ".join("%s - %s" % pair for pair in touched[:3])
    in_part = "counts as far as the exercise is done"
    if done_share == 0.0:
        return [Criterion(name, 0.0, weight, in_part)
                for name, weight in (("smoothness", smooth), ("collisions", clear), ("time", quick))]

    def criterion(name: str, share: float, weight: float, found: str) -> Criterion:
        return Criterion(name, done_share * share, weight,
                         "%s; %s" % (found, in_part) if share == 1.0 > done_share else found)

    return [
        criterion("smoothness", ramp(stops, halts_allowed, halts_allowed + 12), smooth,
                  "the arm went smoothly" if stops <= halts_allowed else "the arm stood still %s on its way; %s "
                  "part of it" % (counted(stops, "time"), "1 is" if halts_allowed == 1 else "%d are" % halts_allowed)),
        criterion("collisions", 0.0 if touched else 1.0, clear, "touched: " + text if touched else "none"),
        criterion("time", ramp(lasted, call.lasts_s, 2.0 * call.lasts_s), quick,
                  "%.1f s of %.0f s" % (lasted, call.lasts_s)),
    ]


def _duration(recording: RunRecording) -> float:
    arms = np.hstack([recording.arm(side) for side in SIDES]) if len(recording.times) else np.empty((0, 14))
    rows = measures.moving_rows(recording.times, arms)
    return float(recording.times[rows[1]] - recording.times[0]) if rows else 0.0


class RotateGripper(ExerciseTask[tuple[str, float]]):
    """`rotate_gripper.py AXIS DEGREES`: the left gripper to the lab's pose, then turned about its own axis."""

    def calls(self, rng: Generator) -> list[ProgramCall[tuple[str, float]]]:
        return [ProgramCall((axis, "%d" % degrees), postures(rng), 45.0, (axis, math.radians(degrees)), 22.0)
                for axis, degrees in (("z", 90), ("x", 90), ("y", -90))]

    def _target(self, call: ProgramCall[tuple[str, float]]) -> tuple[np.ndarray, np.ndarray]:
        axis, angle = call.expected
        start = pose_matrix(LAB_POINT, LAB_QUATERNION)
        target = start.copy()
        target[:3, :3] = start[:3, :3] @ mistakes.about(axis, angle)
        return start, target

    def criteria(self, call: ProgramCall[tuple[str, float]], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        position = orientation = 0.0
        distance, angle = math.inf, math.inf
        recording = run.recording
        if measures.has_moved(recording.arm("left")):
            distance, angle = measures.pose_error(robot.gripper("left", recording), self._target(call)[1])
            position = ramp(distance, *OFF_M)
            orientation = position * ramp(angle, *OFF_RAD)
        reached = turned = "the arm did not move"
        if math.isfinite(distance):
            reached = "%.1f cm off" % (100 * distance) if position < 1.0 else "within %g cm" % (100 * OFF_M[0])
            turned = ("%s off" % counted(round(math.degrees(angle)), "degree") if angle > OFF_RAD[0] else
                      "within %g degrees" % round(math.degrees(OFF_RAD[0])))
        return [Criterion("position", position, 20.0, reached), Criterion("orientation", orientation, 40.0, turned),
                *motion_criteria(run, ("left",), min(position, orientation), call, (10.0, 15.0, 15.0), 4)]

    def slip(self, call: ProgramCall[tuple[str, float]], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        axis, angle = call.expected
        start, target = self._target(call)
        requests = run.recording.ik_requests()
        for _, frame, xyz, xyzw, _ in requests:
            if frame.lstrip("/") not in ("base", "world", ""):
                return RunFault("wrong_frame",
                                "the IK service was asked for a pose in the frame `%s`; the pose of this "
                                "exercise is given in `base` (header.frame_id)" % frame)
            pose = pose_matrix(xyz, xyzw)
            if measures.pose_error(pose, start)[0] < mistakes.NEAR_M:
                fault = self._rotation_fault(pose, start, target, axis, angle)
                if fault and fault.key != "not_turned":
                    return fault
        return (self._reached_fault(run, robot, start, target, axis, angle)
                or self._missed(run, robot, start, bool(requests)))

    @staticmethod
    def _missed(run: ProgramRun, robot: JudgedRobot, start: np.ndarray, has_asked: bool) -> RunFault | None:
        """A RunFault for an arm that is at another place without a known mistake."""
        distance = measures.pose_error(robot.gripper("left", run.recording), start)[0]
        if distance < 0.05 or not measures.has_moved(run.recording.arm("left")):
            return None
        text = "the left gripper ended %.0f cm from the lab's pose, where it is to be turned" % (100.0 * distance)
        if not has_asked:
            text += "; the IK service was never asked for joint angles"
        return RunFault("far_off", text)

    def _rotation_fault(self, pose: np.ndarray, start: np.ndarray, target: np.ndarray, axis: str,
                        angle: float) -> RunFault | None:
        rotation = pose[:3, :3]
        if mistakes.is_near(rotation, target[:3, :3]) or mistakes.is_near(rotation, start[:3, :3]):
            return None
        for key, sentence, wrong in mistakes.wrong_rotations(start[:3, :3], axis, angle):
            if mistakes.is_near(rotation, wrong):
                if key == "quaternion_order":
                    sentence += "; " + mistakes.SHEET_ROTATE
                return RunFault(key, sentence)
        return None

    def _reached_fault(self, run: ProgramRun, robot: JudgedRobot, start: np.ndarray, target: np.ndarray, axis: str,
                       angle: float) -> RunFault | None:
        if not run.recording.records:
            return None
        reached = robot.gripper("left", run.recording)
        distance, turned = measures.pose_error(reached, target)
        if distance < mistakes.NEAR_M and turned < mistakes.NEAR_RAD:
            return None
        joints = run.recording.joints_at(-1)
        for frame in ("left_hand", "left_wrist", "left_gripper_base"):
            if measures.pose_error(robot.frame(frame, joints), target)[0] < mistakes.NEAR_M:
                return RunFault("wrong_frame", "at the end `%s` is where `left_gripper` was to be: the IK service "
                                "commands `left_gripper`, and so must the pose be one of that frame" % frame)
        if distance < mistakes.NEAR_M:
            fault = self._rotation_fault(reached, start, target, axis, angle)
            if fault:
                return fault
            if mistakes.is_near(reached[:3, :3], start[:3, :3]):
                return RunFault("not_turned",
                                "the gripper is at the lab's pose, but it was not turned about its %s axis "
                                "by %.0f degrees" % (axis, math.degrees(angle)))
        return None


class JointCommand(ExerciseTask[tuple[float, ...]]):
    """`joint_command.py Q0 ... Q6`: the right arm to seven angles, s0 to w2, by a stream of joint commands."""

    def calls(self, rng: Generator) -> list[ProgramCall[tuple[float, ...]]]:
        goal = [round(float(angle), 3) for angle in np.array((-0.4, -0.3, 0.5, 1.1, 0.3, 0.8, 0.7))
                + rng.uniform(-0.15, 0.15, 7)]
        return [ProgramCall(tuple(map(str, goal)), postures(rng), 30.0, tuple(goal), 12.0)]

    def criteria(self, call: ProgramCall[tuple[float, ...]], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        share, found = 0.0, "the arm did not move"
        recording = run.recording
        if measures.has_moved(recording.arm("right")):
            share, off, found = measures.distance_from_goal(joint_names("right"), recording.arm("right")[-1],
                                                            call.expected)
            share = share if off < measures.OFF_GOAL_RAD else 0.6 * share
        return [Criterion("joint angles", share, 55.0, found),
                *motion_criteria(run, ("right",), share, call, (15.0, 15.0, 15.0), 1)]

    def slip(self, call: ProgramCall[tuple[float, ...]], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        recording = run.recording
        if measures.has_moved(recording.arm("right")):
            off = np.abs(recording.arm("right")[-1] - np.array(call.expected))
            if off.max() > measures.AT_GOAL_RAD and run.exit_code == 0:
                return RunFault("far_off", "%s ended %.2f rad from its goal: go on sending the goal until "
                                "/robot/joint_states says that the arm is there"
                                % (joint_names("right")[int(off.argmax())], off.max()))
        return None


class Wave(ExerciseTask[None]):
    """`wave.py`: both grippers to and fro along a sine path at the same time, three periods or more, then an end."""

    def calls(self, rng: Generator) -> list[ProgramCall[None]]:
        return [ProgramCall((), postures(rng), 60.0, None, 40.0)]

    def fits(self, run: ProgramRun, robot: JudgedRobot) -> dict[str, measures.SineFit]:
        """The sine of each gripper's path: dict of side to SineFit."""
        recording = run.recording
        return {side: measures.fit_sine(recording.times, robot.gripper_path(side, recording)) for side in SIDES}

    def criteria(self, call: ProgramCall[None], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        fits: dict[str, measures.SineFit] = dict.fromkeys(SIDES, measures.NO_SINE)
        if len(run.recording.times) > 50:
            fits = self.fits(run, robot)
        found, shares = [], []
        for side, fit in fits.items():
            share = (ramp(fit.r_squared, 0.95, 0.6) * ramp(fit.amplitude, AMPLITUDE_M, 0.01)
                     * min(1.0, fit.periods / PERIODS))
            shares.append(share)
            moved = "%s: %.1f periods of %.0f cm to either side, %.0f %% a sine" % (
                side, fit.periods, 100 * fit.amplitude, 100 * max(0.0, fit.r_squared))
            found.append(moved if fit.periods else "%s: no wave" % side)
        together = self._together(fits)
        # The windows of the two fits may begin and end at slightly different times.
        in_step = ramp(together, 0.8, 0.2)
        done = min(shares)
        return [Criterion("left wave", shares[0], 22.5, found[0]), Criterion("right wave", shares[1], 22.5, found[1]),
                Criterion("at the same time", done * in_step, 15.0,
                          "%.0f %% of the time" % (100 * together)),
                # A waving hand stops at both ends of its path.
                *motion_criteria(run, SIDES, done, call, (15.0, 15.0, 10.0),
                                 4 + round(3 * max(fit.periods for fit in fits.values())))]

    @staticmethod
    def _together(fits: dict[str, measures.SineFit]) -> float:
        left, right = (fits[side] for side in SIDES)
        if not (left.periods and right.periods):
            return 0.0
        both = min(left.end, right.end) - max(left.start, right.start)
        return float(np.clip(both / min(left.end - left.start, right.end - right.start), 0.0, 1.0))

    def slip(self, call: ProgramCall[None], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        if len(run.recording.times) < 50:
            return None
        fits = self.fits(run, robot)
        still = [side for side in SIDES if not measures.has_moved(run.recording.arm(side))]
        if len(still) == 1:
            return RunFault("one_arm", "only one arm moved; the %s arm stood still, and both are to wave" % still[0])
        none = [side for side, fit in fits.items() if not fit.periods]
        if none and not still:
            return RunFault("no_wave", "the %s gripper moved, but nothing in its path is a sine of more than one period"
                            % " and the ".join(none))
        if all(fit.periods and fit.periods < PERIODS for fit in fits.values()):
            return RunFault("too_short", "both arms wave, but for fewer than three periods (%.1f)"
                            % min(fit.periods for fit in fits.values()))
        small = [side for side, fit in fits.items() if fit.periods and fit.amplitude < AMPLITUDE_M]
        if small:
            return RunFault("too_small", "the %s gripper's wave goes %.0f mm to either side; 5 cm are due"
                            % (small[0], 1000 * fits[small[0]].amplitude))
        return None
