# SPDX-License-Identifier: BSD-3-Clause
"""The command language of moveit_commander_cmdline.py: one line in, one answer out."""
from __future__ import annotations

import re
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import rosgraph
from geometry_msgs.msg import PoseStamped

from command_line.options import counted
from urdf_model import bounds, read_text

from .conversions import list_to_pose
from .exception import MoveItCommanderException
from .planning_scene_interface import PlanningSceneInterface
from .robot import RobotCommander
from .states import named_positions

if TYPE_CHECKING:
    from moveit_commander.move_group import MoveGroupCommander

    #: An answer, or (level of MoveGroupInfoLevel, answer).
    Answer = str | tuple[int, str]

__all__ = ["MoveGroupCommandInterpreter", "MoveGroupInfoLevel"]

#: The slab that `ground` puts under the robot: size [m]; its top is a little below zero, so that nothing is inside it.
_GROUND_SIZE, _GROUND_TOP = (3.0, 3.0, 0.1), -0.01
_FILE = "move_group.cfg"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SWITCHES = {"true": True, "on": True, "1": True, "t": True, "false": False, "off": False, "0": False, "f": False}
_SHORT = {"tol": "tolerance", "rec": "record", "del": "delete", "random": "rand", "q": "quit", "exit": "quit"}
# For the robot's SRDF.
_STATE = """\
<group_state name="custom_state" group="%s">
%s
</group_state>"""
_STATE_JOINT = '    <joint name="%s" value="%.17g"/>'

_HELP = """\
use NAME, use previous   work with this group; with the one before
use, groups              the groups that were used
id, which                the group in use
joints, eef              its joints; its end effector's link
current                  its joint values and poses now
vars, show [NAME], NAME  names of states; a state's values, or all of them
group_state              where it is now, as a state for the SRDF
record NAME, rand NAME   remember where it is now, or random values, under a name
delete NAME              forget it
x = y, x = [1 2 3], x[0] = 0.5   a new name for a state; values under a name; one of them
save [FILE], load [FILE] write remembered states into a file; run the commands in a file
plan NAME, plan rand     plan to a state, to a random one; plan alone shows the last plan
execute                  execute that plan
go NAME, go rand         plan and execute
go up|down|left|right|forward|backward D   move D metres along the planning frame's z, y or x; x, y, z do as well
go X Y Z R P Y [approx]  plan and execute to a pose; approx: or to the nearest that can be reached
rotate R P Y             plan and execute to this roll, pitch and yaw
pick NAME, place NAME    pick an object up; put it down
stop                     stop moving
tolerance [D], time [S]  show or set the goal's tolerance; how long planning may take
planner NAME             use this planner
constrain [NAME]         hold stored constraints on the way; hold none
allow looking|replanning true|false
trace on|off             name what is done while it is done
database, host           where stored constraints are; where the master is
ground                   put a floor into the scene
wait S                   wait
help, quit"""


class MoveGroupInfoLevel:
    """How to understand an answer."""

    FAIL, WARN, SUCCESS, INFO, DEBUG = 1, 2, 3, 4, 5


class MoveGroupCommandInterpreter:
    """Carries out commands for the groups of a robot.

    robot, scene: a RobotCommander and a PlanningSceneInterface, made when they are not given.
    """

    DEFAULT_FILENAME = _FILE
    # What go DIRECTION DISTANCE does: axis of the planning frame, sign.
    GO_DIRS = {"up": (2, 1), "down": (2, -1), "left": (1, 1), "right": (1, -1), "forward": (0, 1), "backward": (0, -1),
               "back": (0, -1), "x": (0, 1), "y": (1, 1), "z": (2, 1)}

    def __init__(self, robot: RobotCommander | None = None, scene: PlanningSceneInterface | None = None) -> None:
        self._robot, self._scene = robot or RobotCommander(), scene or PlanningSceneInterface()
        self._groups, self._group_name, self._previous_name = {}, "", ""
        self._plan = None
        self._trace = False
        # The first word of a command to what does it.
        self._without_group = {"help": self._help, "id": self._which, "which": self._which, "groups": self._loaded,
                               "use": self._use, "wait": self._wait, "trace": self._set_trace, "load": self._load,
                               "ground": self._ground, "database": self._database, "host": self._host,
                               "quit": self._quit}
        self._with_group = {"joints": self._joints, "eef": self._end_effector, "current": self._current,
                            "vars": self._variables, "show": self._show, "group_state": self._group_state,
                            "record": self._record, "rand": self._record_random, "delete": self._delete,
                            "save": self._save, "plan": self._make_plan,
                            "execute": self._execute, "go": self._go, "rotate": self._rotate, "pick": self._pick,
                            "place": self._place, "stop": self._stop, "tolerance": self._tolerance,
                            "time": self._time, "planner": self._planner, "constrain": self._constrain,
                            "allow": self._allow}

    def get_active_group(self) -> MoveGroupCommander | None:
        """Return the MoveGroupCommander of the group in use, None before `use`."""
        return self._groups.get(self._group_name)

    def get_loaded_groups(self) -> list[str]:
        """Return the names of the groups that were used."""
        return list(self._groups)

    def get_help(self) -> str:
        """Return what can be said."""
        return _HELP

    def get_keywords(self) -> dict[str, list[str]]:
        """Return {word: words that can follow}, for completion."""
        known = self._known_names() if self._group_name else []
        followers = {"use": self._robot.get_group_names(), "go": [*known, "rand", *self.GO_DIRS],
                     "plan": [*known, "rand"], "show": known, "delete": known, "trace": ["on", "off"],
                     "allow": ["looking", "replanning"]}
        return {word: followers.get(word, []) for word in (*self._without_group, *self._with_group)}

    def execute(self, cmd: str) -> tuple[int, str]:
        """Carry out one command and return (level of MoveGroupInfoLevel, answer)."""
        text = cmd.partition("#")[0].strip()
        if not text:
            return MoveGroupInfoLevel.SUCCESS, ""
        try:
            answer = self._do(text)
        except (MoveItCommanderException, RuntimeError, ValueError, OSError) as error:
            return MoveGroupInfoLevel.FAIL, str(error)
        if isinstance(answer, tuple):
            return answer
        return MoveGroupInfoLevel.SUCCESS, answer

    def _do(self, text: str) -> Answer:
        if "=" in text:
            return self._assign(*(part.strip() for part in text.split("=", 1)))
        first, *words = text.split()
        word = _SHORT.get(first.lower(), first.lower())
        if word in self._without_group:
            return self._without_group[word](words)
        if not words and self._group_name and first in self._known_names():
            return MoveGroupInfoLevel.INFO, _list(self._values(first))
        if word not in self._with_group:
            return MoveGroupInfoLevel.FAIL, "unknown command '%s'; help lists them" % text
        self._group()
        return self._with_group[word](words)

    def _group(self) -> MoveGroupCommander:
        group = self.get_active_group()
        if group is None:
            raise MoveItCommanderException("no group in use; use one of %s" % ", ".join(self._robot.get_group_names()))
        return group

    # -- without a group --------------------------------------------------------------------------------------------

    def _help(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, _HELP

    def _which(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, self._group_name or "no group in use"

    def _loaded(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, "\n".join(self._groups) or "no group in use"

    def _use(self, words: list[str]) -> Answer:
        if not words:
            return self._loaded(words)
        name = words[0]
        if name == "previous":
            name = self._previous_name or self._group_name
        if not self._robot.has_group(name):
            raise MoveItCommanderException("there is no group '%s'; the robot has %s"
                                           % (name, ", ".join(self._robot.get_group_names())))
        if name not in self._groups:
            self._groups[name] = self._robot.get_group(name)
        if name != self._group_name:
            self._group_name, self._previous_name = name, self._group_name
        return "using group %s" % name

    def _wait(self, words: list[str]) -> Answer:
        time.sleep(_number(words, "wait S"))
        return ""

    def _set_trace(self, words: list[str]) -> Answer:
        self._trace = _switch(words, "trace on|off")
        return "trace is %s" % ("on" if self._trace else "off")

    def _load(self, words: list[str]) -> Answer:
        path = Path(words[0] if words else self.DEFAULT_FILENAME)
        if not path.exists() and (Path("cmd") / path).is_file():
            path = Path("cmd") / path
        answers = []
        for line in read_text(path, bounds.DESCRIPTION_BYTES).splitlines():
            level, answer = self.execute(line)
            if self._trace and line.strip():
                answers.append(line)
            if answer:
                answers.append(answer)
            if level == MoveGroupInfoLevel.FAIL:
                return level, "\n".join(answers)
        return "\n".join(answers) or "%s is done" % path

    def _ground(self, words: list[str]) -> Answer:
        pose = PoseStamped()
        pose.header.frame_id = self._robot.get_planning_frame()
        pose.pose.position.z, pose.pose.orientation.w = _GROUND_TOP - 0.5 * _GROUND_SIZE[2], 1.0
        # Held by the root link, which may touch it.
        self._scene.attach_box(self._robot.get_root_link(), "ground", pose, _GROUND_SIZE)
        return "there is a ground"

    def _database(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, "no data base of constraints"

    def _host(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, "the master is %s" % rosgraph.get_master_uri()

    def _quit(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, "quit"

    # -- with a group -----------------------------------------------------------------------------------------------

    def _joints(self, words: list[str]) -> Answer:
        joints = self._group().get_active_joints()
        return MoveGroupInfoLevel.INFO, "\n".join("%d = %s" % pair for pair in enumerate(joints))

    def _end_effector(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, self._group().get_end_effector_link() or "no end effector"

    def _current(self, words: list[str]) -> Answer:
        group = self._group()
        text = "joints = %s" % _list(group.get_current_joint_values())
        if group.has_end_effector_link():
            text += "\n%s pose = %s\nroll, pitch, yaw = %s" % (
                group.get_end_effector_link(), group.get_current_pose(), _list(group.get_current_rpy()))
        return MoveGroupInfoLevel.INFO, text

    def _known_names(self) -> list[str]:
        return self._group().get_named_targets()

    def _variables(self, words: list[str]) -> Answer:
        return MoveGroupInfoLevel.INFO, "\n".join(self._known_names()) or "no states"

    def _show(self, words: list[str]) -> Answer:
        names = words[:1] or self._known_names()
        return MoveGroupInfoLevel.INFO, "\n".join("%s = %s" % (name, _list(self._values(name))) for name in names)

    def _values(self, name: str) -> list[float]:
        """Values of a state in the group's order; joints that a named state leaves out stand where they are."""
        now = self._values_now()
        return list({**now, **self._group().get_named_target_values(name)}.values())

    def _values_now(self) -> dict[str, float]:
        """{joint: value}, in the group's order."""
        group = self._group()
        now = named_positions(group.get_current_state().joint_state)
        return {joint: now[joint] for joint in group.get_joints() if joint in now}

    def _group_state(self, words: list[str]) -> Answer:
        if words:
            return self._show(words)
        return MoveGroupInfoLevel.INFO, _STATE % (
            self._group_name, "\n".join(_STATE_JOINT % one for one in self._values_now().items()))

    def _record(self, words: list[str]) -> Answer:
        self._group().remember_joint_values(_name(words, "record NAME"))
        return "remembered as %s" % words[0]

    def _record_random(self, words: list[str]) -> Answer:
        group = self._group()
        group.remember_joint_values(_name(words, "rand NAME"), group.get_random_joint_values())
        return "remembered as %s" % words[0]

    def _delete(self, words: list[str]) -> Answer:
        name = _name(words, "delete NAME")
        if name not in self._group().get_remembered_joint_values():
            raise MoveItCommanderException("nothing is remembered as '%s'" % name)
        self._group().forget_joint_values(name)
        return "%s is forgotten" % name

    def _save(self, words: list[str]) -> Answer:
        path = Path(words[0] if words else self.DEFAULT_FILENAME)
        lines = []
        for name, group in self._groups.items():
            lines += ["use %s" % name, *("%s = %s" % (state, _list(values))
                                         for state, values in group.get_remembered_joint_values().items())]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return "written to %s" % path

    def _assign(self, name: str, value: str) -> Answer:
        group = self._group()
        cell = re.fullmatch(r"(\w+)\[(\d+)\]", name)
        if cell:
            name, index = cell[1], int(cell[2])
            values = self._values(name)
            if index >= len(values):
                raise MoveItCommanderException("'%s' has %s; there is no [%d]" % (name, counted(len(values), "value"),
                                                                                  index))
            values[index] = float(value)
        elif value.startswith("["):
            values = [float(number) for number in re.findall(_NUMBER, value)]
        else:
            values = self._values(value)
        group.remember_joint_values(name, values)
        return "%s = %s" % (name, _list(values))

    def _target(self, words: list[str], usage: str) -> None:
        name = _name(words, usage)
        if name in ("rand", "random"):
            self._group().set_random_target()
        else:
            self._group().set_named_target(name)

    def _make_plan(self, words: list[str]) -> Answer:
        if not words:
            return MoveGroupInfoLevel.INFO, "no plan" if self._plan is None else str(self._plan[1])
        self._target(words, "plan NAME")
        self._plan = self._group().plan()
        return "planned" if self._plan[0] else (MoveGroupInfoLevel.FAIL, "no plan")

    def _execute(self, words: list[str]) -> Answer:
        if self._plan is None:
            raise MoveItCommanderException("there is no plan; plan NAME makes one")
        plan, self._plan = self._plan, None
        return _done(self._group().execute(plan), "executed", "not executed")

    def _go(self, words: list[str]) -> Answer:
        group = self._group()
        if len(words) == 2 and words[0] in self.GO_DIRS:
            axis, sign = self.GO_DIRS[words[0]]
            group.shift_pose_target(axis, sign * float(words[1]))
        elif len(words) == 7 and words[6] in ("approx", "approximate"):
            group.set_joint_value_target(list_to_pose([float(word) for word in words[:6]]), True)
        elif len(words) == 6:
            group.set_pose_target([float(word) for word in words])
        else:
            self._target(words, "go NAME, or go DIRECTION DISTANCE")
        done = group.go()
        group.clear_pose_targets()
        return _done(done, "moved", "did not move to %s" % " ".join(words))

    def _rotate(self, words: list[str]) -> Answer:
        if len(words) != 3:
            raise MoveItCommanderException("expected: rotate ROLL PITCH YAW")
        group = self._group()
        group.set_rpy_target([float(word) for word in words])
        done = group.go()
        group.clear_pose_targets()
        return _done(done, "turned", "did not turn")

    def _pick(self, words: list[str]) -> Answer:
        code = self._group().pick(_name(words, "pick NAME"))
        return _done(code == 1, "picked %s up" % words[0], "did not pick %s up (%d)" % (words[0], code))

    def _place(self, words: list[str]) -> Answer:
        code = self._group().place(_name(words, "place NAME"))
        return _done(code == 1, "placed %s" % words[0], "did not place %s (%d)" % (words[0], code))

    def _stop(self, words: list[str]) -> Answer:
        self._group().stop()
        return "stopped"

    def _tolerance(self, words: list[str]) -> Answer:
        if words:
            self._group().set_goal_tolerance(_number(words, "tolerance D"))
        return MoveGroupInfoLevel.INFO, "joints, position, orientation: %s" % _list(self._group().get_goal_tolerance())

    def _time(self, words: list[str]) -> Answer:
        if words:
            self._group().set_planning_time(_number(words, "time S"))
        return MoveGroupInfoLevel.INFO, "%g s" % self._group().get_planning_time()

    def _planner(self, words: list[str]) -> Answer:
        self._group().set_planner_id(_name(words, "planner NAME"))
        return "planner is %s" % words[0]

    def _constrain(self, words: list[str]) -> Answer:
        self._group().set_path_constraints(words[0] if words else None)
        return "no constraints"

    def _allow(self, words: list[str]) -> Answer:
        allow = {"looking": self._group().allow_looking, "replanning": self._group().allow_replanning}
        what = [name for name in allow if words and name in (words[0], words[0] + "ing", words[0] + "ning")]
        if len(words) != 2 or not what:
            raise MoveItCommanderException("expected: allow looking|replanning true|false")
        value = _switch(words[1:], "allow %s true|false" % what[0])
        allow[what[0]](value)
        return "%s is %s" % (what[0], "allowed" if value else "not allowed")


def _done(success: bool, yes: str, no: str) -> Answer:
    return yes if success else (MoveGroupInfoLevel.FAIL, no)


def _name(words: list[str], usage: str) -> str:
    if len(words) != 1:
        raise MoveItCommanderException("expected: %s" % usage)
    return words[0]


def _number(words: list[str], usage: str) -> float:
    if len(words) != 1 or not re.fullmatch(_NUMBER, words[0]):
        raise MoveItCommanderException("expected: %s" % usage)
    return float(words[0])


def _switch(words: list[str], usage: str) -> bool:
    if len(words) != 1 or words[0].lower() not in _SWITCHES:
        raise MoveItCommanderException("expected: %s" % usage)
    return _SWITCHES[words[0].lower()]


def _list(values: Iterable[float]) -> str:
    return "[%s]" % " ".join("%.6g" % value for value in values)
