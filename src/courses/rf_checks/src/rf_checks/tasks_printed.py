# SPDX-License-Identifier: BSD-3-Clause
"""Exercises whose answer is printed. The truth comes from the simulated robot itself, not from topics. Free of ROS.

Each answer has a form that holds one: the last matrices, as many as are asked for; the line with the verdict; one name.
A program that prints all it could be has not answered.
"""
from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import NoSolution
from baxter_model import SIDES
from command_line.options import counted
from rf_checks import measures, mistakes
from rf_checks.measures import ramp
from rf_checks.recording import Criterion, RunFault
from rf_checks.tasks import LAB_POINT, LAB_QUATERNION, ExerciseTask, ProgramCall, pose_matrix, postures

if TYPE_CHECKING:
    from numpy.random import Generator

    from rf_checks.recording import ProgramRun
    from rf_checks.robot import JudgedRobot

SHEET_PAIRS = (("base", "left_hand"), ("left_hand", "right_hand"), ("head_camera", "left_gripper_base"))
# Frames that a wrong answer is compared with first.
FRAMES = ("base", "head", "head_camera", "left_hand", "right_hand", "left_gripper", "right_gripper",
          "left_gripper_base", "right_gripper_base", "torso", "left_wrist", "right_wrist")
# Up to the first a matrix gets all points, from the second on none [m], [rad].
OFF_M, OFF_RAD = (0.003, 0.02), (0.01, 0.05)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_METRES = re.compile(r"(%s)\s*m(?:et(?:er|re)s?)?\b" % _NUMBER.pattern)
_JOINT = re.compile(r"\b(?:left|right)_[sew][0-2]\b")
#: Numbers of a line that may be the distance: beside it a program prints the angle, and perhaps the verdict's number.
MAX_NUMBERS = 3
_NOT_ROW = re.compile(r"[^\s\d.,;\[\]()eE+-]")


def matrices(text: str) -> list[np.ndarray]:
    """All 4 by 4 matrices in a text, as printed by numpy, as lists or as plain rows: list of (4, 4) arrays."""
    found, rows = [], []
    for line in text.splitlines():
        if "[[" in line:
            line, rows = line[line.rindex("[["):] if "]]" not in line else line[line.index("[["):], []
        if "]]" in line:
            line = line[:line.rindex("]]")]
        numbers = [float(word) for word in _NUMBER.findall(line)]
        if _NOT_ROW.search(line) or len(numbers) not in (4, 16) or not all(map(math.isfinite, numbers)):
            rows = []
            continue
        rows += [numbers[k:k + 4] for k in range(0, len(numbers), 4)]
        if len(rows) >= 4 and np.allclose(rows[-1], (0, 0, 0, 1), atol=1e-6):
            found.append(np.array(rows[-4:]))
            rows = []
    return found


def last_matrices(text: str, count: int) -> list[np.ndarray]:
    """The last `count` different matrices in a text, in their order: list of (4, 4). A program in a loop prints each
    again and again."""
    found = []
    for matrix in reversed(matrices(text)):
        if not any(_near(matrix, other) for other in found):
            found.append(matrix)
        if len(found) == count:
            break
    return found[::-1]


class TfListener(ExerciseTask[tuple[tuple[str, str], ...]]):
    """`tf_listener.py [TARGET SOURCE]`: prints the matrix of that pair, or of the sheet's three, and no other last."""

    def calls(self, rng: Generator) -> list[ProgramCall[tuple[tuple[str, str], ...]]]:
        pairs = [(a, b) for a, b in (("head", "right_hand"), ("right_hand", "head_camera"), ("left_gripper", "torso"))]
        pair = pairs[int(rng.integers(len(pairs)))]
        return [ProgramCall((), postures(rng, 0.3), 15.0, SHEET_PAIRS),
                ProgramCall(pair, postures(rng, 0.3), 15.0, (pair,))]

    def is_satisfied(self, call: ProgramCall[tuple[tuple[str, str], ...]], run: ProgramRun) -> bool:
        return len(matrices(run.output)) >= len(call.expected)

    def criteria(self, call: ProgramCall[tuple[tuple[str, str], ...]], run: ProgramRun,
                 robot: JudgedRobot) -> list[Criterion]:
        found = last_matrices(run.output, len(call.expected))
        result = []
        for target, source in call.expected:
            distance, angle = np.inf, np.inf
            if run.recording.records:
                true = robot.between(target, source, run.recording.joints_at(-1))
                distance, angle = min((measures.pose_error(matrix, true) for matrix in found), key=sum,
                                      default=(np.inf, np.inf))
            share = min(ramp(distance, *OFF_M), ramp(angle, *OFF_RAD))
            none = ("the last matrix printed is not this" if len(call.expected) == 1 else
                    "none of the last %s printed is this"
                    % counted(len(call.expected), "matrix", "matrices")) if found else "none printed"
            text = none if share == 0.0 else (
                "as it is" if share == 1.0 else "%.1f mm and %.3f rad off" % (1000 * distance, angle))
            result.append(Criterion("%s -> %s" % (target, source), share, 100.0 / len(call.expected), text))
        return result

    def slip(self, call: ProgramCall[tuple[tuple[str, str], ...]], run: ProgramRun,
             robot: JudgedRobot) -> RunFault | None:
        found = last_matrices(run.output, len(call.expected))
        if not run.recording.records:
            return None
        joints = run.recording.joints_at(-1)
        unused = [matrix for matrix in found
                  if not any(_near(matrix, robot.between(*pair, joints)) for pair in call.expected)]
        missing = [pair for pair in call.expected
                   if not any(_near(matrix, robot.between(*pair, joints)) for matrix in found)]
        if missing and any(_near(matrix, robot.between(*missing[0], joints)) for matrix in matrices(run.output)):
            return RunFault("too_many", "the matrix of %s -> %s was printed, but others after it: the last %d that are "
                            "printed count, one for each pair; print no others" % (*missing[0], len(call.expected)))
        for matrix in unused if missing else ():
            slip = mistakes.matrix_slip(matrix, robot, joints, missing, FRAMES)
            if slip:
                return RunFault(*slip)
        if missing and unused:
            return RunFault("wrong_numbers",
                            "a matrix was printed that is not a pose of this robot's frames as its arms "
                            "stand now: the arms stand elsewhere in each check, so numbers from another run do not fit")
        if missing and not found:
            return RunFault("no_matrix",
                            "no 4 by 4 matrix was printed for %s -> %s: print the whole matrix, row by row, "
                            "the last row 0 0 0 1" % missing[0])
        return None


def _near(matrix: np.ndarray, true: np.ndarray) -> bool:
    distance, angle = measures.pose_error(matrix, true)
    return distance < 0.01 and angle < 0.03


VERDICTS = ("SOLVED", "OUT_OF_REACH", "JOINT_LIMIT", "NOT_CONVERGED", "SELF_COLLISION", "WORLD_COLLISION")
_VERDICT = re.compile("|".join(VERDICTS))


class Unreachable(ExerciseTask[tuple[float, ...]]):
    """`unreachable.py X Y Z QX QY QZ QW`: prints the IK report's verdict on that pose, and its reason."""

    def calls(self, rng: Generator) -> list[ProgramCall[tuple[float, ...]]]:
        down = pose_matrix((0, 0, 0), (0.0, 1.0, 0.0, 0.0))[:3, :3]
        turned = mistakes.quaternion_of(down @ mistakes.about("y", -np.pi / 2))
        kinds = ((LAB_POINT, LAB_QUATERNION), ((1.5, 0.6, 0.2), (0.0, 1.0, 0.0, 0.0)), ((0.6, 0.3, 0.3), turned))
        calls = []
        for point, quaternion in kinds:
            point = np.array(point) + rng.uniform(-0.004, 0.004, 3)
            words = tuple("%.4f" % value for value in (*point, *quaternion))
            calls.append(ProgramCall(words, postures(rng), 12.0, tuple(float(word) for word in words)))
        return calls

    @staticmethod
    def _truth(call: ProgramCall[tuple[float, ...]], robot: JudgedRobot) -> NoSolution | None:
        answer = robot.solve("left", call.expected[:3], call.expected[3:])
        return answer if isinstance(answer, NoSolution) else None

    def criteria(self, call: ProgramCall[tuple[float, ...]], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        failure = self._truth(call, robot)
        verdict = failure.reason.name if failure else "SOLVED"
        lines = [line for line in run.output.splitlines() if _VERDICT.search(line)]
        said = sorted(set(_VERDICT.findall(lines[-1]))) if lines else []
        is_right = said == [verdict]
        asked = any(np.allclose(request[2], call.expected[:3], atol=1e-3) for request in run.recording.ik_requests())
        reason = is_right and asked and self._says_why(failure, lines[-1])
        missing = ("the line with %s does not say how far short" if failure and not failure.joints else
                   "the line with %s does not name the joint, or names others")
        return [Criterion("verdict", float(is_right and asked), 70.0,
                          "said %s, it is %s" % (" and ".join(said) or "nothing", verdict) if asked else
                          "the IK service was not asked for this pose"),
                Criterion("reason", float(reason), 30.0, "given" if reason else missing % verdict if is_right else
                          "counts with the right verdict")]

    @staticmethod
    def _says_why(failure: NoSolution | None, line: str) -> bool:
        """Whether a line of the output gives the reason, and no other."""
        if failure is None:
            return True
        if failure.joints:
            named = set(_JOINT.findall(line))
            return bool(named) and named <= set(failure.joints)
        said = _VERDICT.split(line, maxsplit=1)[-1]
        numbers = [float(word) for word in _METRES.findall(said) or _NUMBER.findall(said)]
        return any(abs(number - failure.residual_m) < max(0.01, 0.1 * failure.residual_m)
                   for number in numbers[:MAX_NUMBERS])

    def slip(self, call: ProgramCall[tuple[float, ...]], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        requests = run.recording.ik_requests()
        for _, frame, xyz, xyzw, _ in requests:
            if frame.lstrip("/") not in ("base", "world", ""):
                return RunFault("wrong_frame",
                                "the IK service was asked for a pose in the frame `%s`; these poses are in "
                                "`base`" % frame)
            wanted = np.array(call.expected[3:])
            if np.allclose(xyz, call.expected[:3], atol=1e-3) and not mistakes.is_near(
                    pose_matrix(xyz, xyzw)[:3, :3], pose_matrix(xyz, wanted)[:3, :3]):
                return RunFault("quaternion_order",
                                "the IK service was asked for another orientation than the one given: "
                                "the arguments are x y z w, as in ROS")
        if not any(np.allclose(request[2], call.expected[:3], atol=1e-3) for request in requests):
            if _VERDICT.search(run.output):
                return RunFault("made_up",
                                "a verdict was printed although the IK service was never asked for this pose")
            return RunFault("not_asked",
                            "the IK service of the left arm was never asked for the pose on the command line")
        if not _VERDICT.search(run.output):
            return RunFault("no_verdict", "the IK service was asked, but no verdict was printed: one of %s, from the "
                            "topic /ExternalTools/left/PositionKinematicsNode/IKReport" % ", ".join(VERDICTS[:3]))
        return None


class IkFrame(ExerciseTask[None]):
    """`ik_frame.py`: finds out by an experiment the reference frame of poses and the frame that is moved there; prints
    both."""

    def calls(self, rng: Generator) -> list[ProgramCall[None]]:
        return [ProgramCall((), postures(rng), 40.0, None, 20.0)]

    @staticmethod
    def answers(text: str) -> tuple[str, str]:
        """(reference frame, commanded frame) as printed: "" where there is none, all names where there are several."""
        found = []
        for name in ("reference frame", "commanded frame"):
            said = dict.fromkeys(re.findall(name + r"\s*[:=]\s*/?([A-Za-z]\w*)", text, re.IGNORECASE))
            found.append(" and ".join([*said][:3]) + (" and others" if len(said) > 3 else ""))
        reference, commanded = found
        return reference, commanded

    def criteria(self, call: ProgramCall[None], run: ProgramRun, robot: JudgedRobot) -> list[Criterion]:
        reference, commanded = self.answers(run.output)
        asked, arrived, found = self._experiment(run, robot)
        return [
            Criterion("reference frame", float(asked and reference in ("base", "world")), 20.0,
                      "said %s%s" % (reference or "nothing", "" if asked else "; counts with the experiment")),
            Criterion("commanded frame", float(arrived > 0.0 and commanded in ("left_gripper", "right_gripper")), 25.0,
                      "said %s%s" % (commanded or "nothing", "" if arrived else "; counts with the experiment")),
            Criterion("asked the service", float(asked), 15.0,
                      "yes" if asked else "no pose with a solution was asked for"),
            Criterion("went to look", arrived, 40.0, found),
        ]

    @staticmethod
    def _experiment(run: ProgramRun, robot: JudgedRobot) -> tuple[bool, float, str]:
        recording = run.recording
        solved = [request for request in recording.ik_requests() if request[4] == 0]
        best: tuple[float, str] = 0.0, "no arm moved to a pose that the service had solved"
        for side, _, xyz, xyzw, _ in solved:
            if not measures.has_moved(recording.arm(side)):
                continue
            target = pose_matrix(xyz, xyzw)
            # All poses in which the arm rested.
            rows = [*range(0, len(recording.times), 10), -1]
            poses = [robot.gripper(side, recording, row) for row in rows]
            distance = min(measures.pose_error(pose, target)[0] for pose in poses)
            share = ramp(distance, 0.01, 0.05)
            found = ("at the pose that was asked for" if share == 1.0 else
                     "%.1f cm from the pose that was asked for" % (100 * distance))
            best = max(best, (share, found))
        return bool(solved), best[0], best[1]

    def slip(self, call: ProgramCall[None], run: ProgramRun, robot: JudgedRobot) -> RunFault | None:
        reference, commanded = self.answers(run.output)
        if not reference or not commanded:
            return RunFault("no_answer", "the answers are missing: print two lines, `reference frame: NAME` and "
                            "`commanded frame: NAME`")
        for name, said in (("reference", reference), ("commanded", commanded)):
            if " " in said:
                return RunFault("several_answers",
                                "several %s frames were printed, %s: print the one that you have found"
                                % (name, said))
        if reference not in ("base", "world"):
            return RunFault("wrong_frame", "the reference frame is not `%s`: it is the one that a pose's numbers are "
                            "measured from; ask for one pose with two values of header.frame_id and compare"
                            % reference)
        if commanded not in ["%s_gripper" % side for side in SIDES]:
            return RunFault("wrong_frame", "the commanded frame is not `%s`: move to a solution and look in tf which "
                            "frame then stands at the pose that was asked for" % commanded)
        if not self._experiment(run, robot)[1]:
            return RunFault("made_up",
                            "the answers were printed, but no arm moved to a pose that the service had solved: "
                            "an answer without its experiment")
        return None
