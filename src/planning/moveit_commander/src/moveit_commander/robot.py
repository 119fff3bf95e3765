# SPDX-License-Identifier: BSD-3-Clause
"""The robot as a whole: its groups, joints and links."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import RobotState
from visualization_msgs.msg import MarkerArray

from . import scene_calls, states
from .connection import connect
from .conversions import pose_of
from .description import load
from .exception import MoveItCommanderException
from .markers import link_markers
from .move_group import MoveGroupCommander
from .wrapped import WrappedRobot

if TYPE_CHECKING:
    from motion_planning.model import Group

__all__ = ["RobotCommander"]


class CommanderJoint:
    """A joint of the robot. Raises MoveItCommanderException for an unknown name."""

    def __init__(self, robot: RobotCommander, name: str) -> None:
        if name not in robot.get_joint_names():
            raise MoveItCommanderException("the robot has no joint '%s'" % name)
        self._robot, self._name = robot, name

    def name(self) -> str:
        """Return its name."""
        return self._name

    def variable_count(self) -> int:
        """Return how many values it has: none for a fixed joint, 7 where a base floats."""
        return self._robot.variables_of(self._name)

    def bounds(self) -> list[float | None]:
        """Return [lower, upper], [] for a joint without its own value."""
        return self._robot.bounds_of(self._name)

    def min_bound(self) -> float | None | list[float]:
        """Return the lower limit, [] for a joint without its own value."""
        return (self.bounds() or [[]])[0]

    def max_bound(self) -> float | None | list[float]:
        """Return the upper limit, [] for a joint without its own value."""
        return (self.bounds() or [[]])[-1]

    def value(self) -> float | list[float]:
        """Return its present value; a list for a floating base, [] for a fixed joint."""
        return self._robot.value_of(self._name)

    def move(self, position: float, wait: bool = True) -> bool:
        """Move it alone, with the smallest group that has it; tell whether that succeeded, or was sent."""
        group_name = self._robot.get_default_owner_group(self._name)
        if group_name is None:
            raise MoveItCommanderException("no group has joint '%s'; it cannot be moved" % self._name)
        group = self._robot.get_group(group_name)
        values = self._robot.get_current_variable_values()
        values = {name: values[name] for name in group.get_active_joints()}
        group.set_joint_value_target({**values, self._name: float(position)})
        return group.go(wait)


class CommanderLink:
    """A link of the robot. Raises MoveItCommanderException for an unknown name."""

    def __init__(self, robot: RobotCommander, name: str) -> None:
        if name not in robot.get_link_names():
            raise MoveItCommanderException("the robot has no link '%s'" % name)
        self._robot, self._name = robot, name

    def name(self) -> str:
        """Return its name."""
        return self._name

    def pose(self) -> PoseStamped:
        """Return its PoseStamped now, in the planning frame."""
        return self._robot.pose_of(self._name)


class RobotCommander:
    """Groups, joints and links of the robot that ``robot_description`` describes; its state comes from move_group.

    ``robot.right_arm``, ``robot.left_s0``, ``robot.left_gripper`` are a group's commander, a Joint, a Link.
    Raises RuntimeError without a description. ns: namespace of move_group.
    """

    Joint, Link = CommanderJoint, CommanderLink

    def __init__(self, robot_description: str = "robot_description", ns: str = "") -> None:
        self._robot_description, self._namespace = robot_description, ns
        self._connection = connect(ns)
        self._model = load(robot_description, ns).model
        self._groups = {}
        self._r = WrappedRobot(self)

    # -- names ------------------------------------------------------------------------------------------------------

    def get_planning_frame(self) -> str:
        """Return the frame that planning happens in."""
        return self._model.frame

    def get_root_link(self) -> str:
        """Return the root link."""
        return self._model.root

    def get_group_names(self) -> list[str]:
        """Return the names of all groups."""
        return list(self._model.groups)

    def has_group(self, name: str) -> bool:
        """Tell whether there is a group of this name."""
        return name in self._model.groups

    def get_joint_names(self, group: str | None = None) -> list[str]:
        """Return the names of all joints, of a group or of the robot; fixed ones and those that mimic others, too."""
        if group is not None:
            return list(self._group(group).all_joints)
        floating = self._model.virtual_joint
        joints = [joint.name for link in self._model.links[1:]
                  if (joint := self._model.robot.parent_joint(link)) is not None]
        return [floating.name, *joints] if floating is not None else joints

    def get_active_joint_names(self, group: str | None = None) -> list[str]:
        """Return the names of the joints that can be moved, of a group or of the robot."""
        return list(self._model.variables if group is None else self._group(group).joints)

    def get_link_names(self, group: str | None = None) -> list[str]:
        """Return the names of the links, of a group or of the robot."""
        return list(self._model.links if group is None else self._group(group).links)

    def get_default_owner_group(self, joint_name: str) -> str | None:
        """Return the name of the group with the fewest links that has a joint, None where none has it."""
        self.get_joint(joint_name)
        owners = [group for group in self._model.groups.values() if joint_name in group.all_joints]
        return min(owners, key=lambda group: len(group.links)).name if owners else None

    def _group(self, name: str) -> Group:
        if name not in self._model.groups:
            raise MoveItCommanderException("there is no group '%s'; the robot has %s"
                                           % (name, ", ".join(self._model.groups) or "no groups"))
        return self._model.groups[name]

    # -- parts ------------------------------------------------------------------------------------------------------

    def get_group(self, name: str) -> MoveGroupCommander:
        """Return the MoveGroupCommander of a group, the same one each time."""
        self._group(name)
        if name not in self._groups:
            self._groups[name] = MoveGroupCommander(name, self._robot_description, self._namespace)
        return self._groups[name]

    def get_joint(self, name: str) -> CommanderJoint:
        """Return a :class:`CommanderJoint`."""
        return CommanderJoint(self, name)

    def get_link(self, name: str) -> CommanderLink:
        """Return a :class:`CommanderLink`."""
        return CommanderLink(self, name)

    def __getattr__(self, name: str) -> MoveGroupCommander | CommanderJoint | CommanderLink:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._model.groups:
            return self.get_group(name)
        if name in self.get_joint_names():
            return self.get_joint(name)
        if name in self._model.links:
            return self.get_link(name)
        raise AttributeError("the robot has no group, joint or link '%s'" % name)

    # -- state ------------------------------------------------------------------------------------------------------

    def get_current_state(self) -> RobotState:
        """Return the RobotState now. Raises MoveItCommanderException when move_group does not answer."""
        return scene_calls.robot_state(self._connection)

    def get_current_variable_values(self) -> dict[str, float]:
        """Return {variable: value}; a floating base has seven, as "world_joint/trans_x"."""
        state = states.state_of(self._model, self.get_current_state())
        return {**states.base_variables(self._model, state), **self._model.joint_values(state.q)}

    def pose_of(self, link: str) -> PoseStamped:
        """Return the PoseStamped of a link now, in the planning frame."""
        state = states.state_of(self._model, self.get_current_state())
        message = PoseStamped(pose=pose_of(self._model.frame_of(state.q, link, state.base)))
        message.header.frame_id, message.header.stamp = self._model.frame, rospy.Time.now()
        return message

    def variables_of(self, joint: str) -> int:
        """Return how many values a joint has."""
        if self._is_floating(joint):
            return len(states.base_variables(self._model, self._model.default_state()))
        return int(joint in self._model.index or joint in self._model.mimics)

    def bounds_of(self, joint: str) -> list[float | None]:
        """Return [lower, upper] of a joint, [] if it has no own value or several."""
        if joint in self._model.mimics:
            limit = self._model.robot.joints[joint].limit
            return [limit.lower, limit.upper]
        return self._model.bounds[self._model.index[joint]].tolist() if joint in self._model.index else []

    def value_of(self, joint: str) -> float | list[float]:
        """Return a joint's present value; a list for a floating base, [] for a fixed joint."""
        values = self.get_current_variable_values()
        if self._is_floating(joint):
            return [value for name, value in values.items() if name.startswith(joint + "/")]
        return values.get(joint, [])

    def _is_floating(self, joint: str) -> bool:
        return self._model.virtual_joint is not None and joint == self._model.virtual_joint.name

    def get_robot_markers(self, *args: Any) -> MarkerArray:
        """Return a MarkerArray that draws the robot.

        args: nothing, for where it is now; a RobotState; {joint: value}; these and a list of links; the name of a
        group; a group and {joint: value}.
        """
        state, links = self.get_current_state(), self.get_link_names()
        for argument in args:
            if isinstance(argument, RobotState):
                state = argument
            elif isinstance(argument, str):
                links = self.get_link_names(argument)
            elif isinstance(argument, dict):
                known = dict(zip(state.joint_state.name, state.joint_state.position, strict=True))
                known.update(argument)
                state.joint_state.name, state.joint_state.position = list(known), list(known.values())
            elif isinstance(argument, list | tuple):
                links = list(argument)
            else:
                raise MoveItCommanderException("expected a RobotState, {joint: value}, a list of links or a group's "
                                               "name, got %s" % type(argument).__name__)
        return MarkerArray(link_markers(self._model, states.state_of(self._model, state), links))
