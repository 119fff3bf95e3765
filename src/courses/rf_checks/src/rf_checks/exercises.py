# SPDX-License-Identifier: BSD-3-Clause
"""The table of exercises, and which one a file is meant for. Free of ROS."""
from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from baxter_model import SIDES
from command_line.options import did_you_mean
from rf_checks import tasks, tasks_planning, tasks_printed, tasks_steering

if TYPE_CHECKING:
    from typing import Any

    from rf_checks.tasks import ExerciseTask

#: Points of 100 from which an exercise counts as done.
PASS_MARK = 80.0


@dataclass(frozen=True)
class Exercise:
    """lab, name: as on the command line. words: parts of a file's name that indicate it. sides: arms that must move."""

    lab: str
    name: str
    title: str
    usage: str
    task: ExerciseTask[Any]
    words: tuple[str, ...]
    sides: tuple[str, ...] = ()


class UnknownExercise(Exception):
    """The exercise cannot be determined; the text says how to name it."""


EXERCISES = (
    Exercise("lab2", "tf_listener", "where one frame is in another, as a 4 by 4 matrix",
             "tf_listener.py [TARGET SOURCE]", tasks_printed.TfListener(), ("tf", "listener", "transform")),
    Exercise("lab2", "rotate_gripper", "turn the left gripper about its own x, y or z axis",
             "rotate_gripper.py AXIS DEGREES", tasks.RotateGripper(), ("rotate", "gripper", "rotation"), ("left",)),
    Exercise("lab2", "wave", "wave with both arms along a sine path", "wave.py", tasks.Wave(),
             ("wave", "waving", "sine"), SIDES),
    Exercise("lab2", "unreachable", "say why a pose has no solution", "unreachable.py X Y Z QX QY QZ QW",
             tasks_printed.Unreachable(), ("unreachable", "reach", "report")),
    Exercise("lab2", "ik_frame", "find the frames of the IK service", "ik_frame.py", tasks_printed.IkFrame(),
             ("ik", "frame")),
    Exercise("cwru", "joint_command", "bring the right arm to seven angles by joint commands",
             "joint_command.py Q0 ... Q6", tasks.JointCommand(), ("joint", "command", "stream"), ("right",)),
    Exercise("moveit", "plan_around", "plan the left arm's way around a pillar, to its state left_neutral",
             "plan_around.py X Y Z LX LY LZ", tasks_planning.PlanAround(), ("plan", "around", "pillar"), ("left",)),
    Exercise("steering", "steer_to", "steer the left gripper to a place by twists", "steer_to.py X Y Z",
             tasks_steering.SteerTo(), ("steer", "twist", "servo"), ("left",)),
)
LABS = tuple(dict.fromkeys(exercise.lab for exercise in EXERCISES))
# Texts that only programs of one exercise contain, the most specific first.
_TELLS = tuple((name, re.compile(pattern, re.IGNORECASE)) for name, pattern in (
    ("unreachable", "IKReport"), ("ik_frame", "commanded frame"), ("wave", r"\bsin\("),
    ("rotate_gripper", r"rotate_pose|axangle|[xyz]_rotation"), ("tf_listener", "lookup_transform")))
_MARK = re.compile(r"^\s*#\s*exercise\s*:\s*(\w+)", re.MULTILINE | re.IGNORECASE)


def meant_instead(exercise: Exercise, file_name: str, text: str) -> Exercise | None:
    """The other Exercise that a program is for by its line `# exercise: NAME`, or else by its file's name; or None."""
    mark = _MARK.search(text)
    stem = file_name.removesuffix(".py").lower()
    named = [mark.group(1)] if mark else sorted((one.name for one in EXERCISES if one.name in stem), key=len)
    # The longest: joint_command is no command.
    return next((one for one in EXERCISES if named and one.name == named[-1] and one is not exercise), None)


def choose(lab: str, name: str, file_name: str, text: str) -> Exercise:
    """The Exercise for a lab, the name of an exercise or "", and the program. Raises UnknownExercise.

    Without a name: from a line `# exercise: NAME` in the text; else from the file's name; else from texts that only one
    exercise's programs contain.
    """
    if lab not in LABS:
        owner = next((one.lab for one in EXERCISES if one.name == lab), None)
        hint = "; '%s' is an exercise of %s" % (lab, owner) if owner else did_you_mean(lab, LABS)
        if not hint and (near := difflib.get_close_matches(lab, [one.name for one in EXERCISES], 1)):
            hint = "; did you mean %s %s?" % (next(one.lab for one in EXERCISES if one.name == near[0]), near[0])
        raise UnknownExercise("there is no lab '%s'; labs are %s%s" % (lab, ", ".join(LABS), hint))
    of_lab = {exercise.name: exercise for exercise in EXERCISES if exercise.lab == lab}
    mark = _MARK.search(text)
    for asked, source in ((name, "on the command line"),
                          (mark and mark.group(1), "in the program's `# exercise:` line")):
        if asked:
            elsewhere = next((one for one in EXERCISES if one.name == asked), None)
            if asked not in of_lab and elsewhere:
                raise UnknownExercise("%s is an exercise of %s, not of %s (%s): ./baxter.sh check %s %s %s" % (
                    asked, elsewhere.lab, lab, source, elsewhere.lab, asked, file_name))
            if asked not in of_lab:
                raise UnknownExercise("%s has no exercise '%s' (%s); its exercises are %s%s"
                                      % (lab, asked, source, ", ".join(of_lab), did_you_mean(asked, of_lab)))
            return of_lab[asked]
    if len(of_lab) == 1:
        return next(iter(of_lab.values()))
    words = set(re.split(r"[\W_]+", file_name.removesuffix(".py").lower()))
    scores = {exercise.name: sum(word in words for word in exercise.words) for exercise in of_lab.values()}
    best = max(scores.values())
    winners = [name for name, score in scores.items() if score == best]
    if best and len(winners) == 1:
        return of_lab[winners[0]]
    for name, tell in _TELLS:
        if best == 0 and name in of_lab and tell.search(text):
            return of_lab[name]
    raise UnknownExercise("%s: which exercise of %s is this? Say so:\n%s\n"
                          "or write a line `# exercise: NAME` into the file"
                          % (file_name, lab, "\n".join("  ./baxter.sh check %s %s %s" % (lab, name, file_name)
                                                       for name in of_lab)))
