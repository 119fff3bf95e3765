# SPDX-License-Identifier: BSD-3-Clause
"""A group of joints: its parts, and its state."""
from __future__ import annotations

from typing import TYPE_CHECKING

import genpy
import numpy as np
import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import PlannerInterfaceDescription, RobotState

from urdf_model.transforms import rpy_from_matrix

from . import scene_calls, states
from .conversions import pose_of
from .exception import MoveItCommanderException
from .targets import random_values, values_of, within_limits
from .tuning import Tunable

if TYPE_CHECKING:
    from motion_planning.model import Group, PlanningModel, State

    from .connection import MoveGroupConnection
    from .requests import RequestSettings


class GroupQueries(Tunable):
    """The methods of MoveGroupCommander that read."""

    def __init__(self, connection: MoveGroupConnection, model: PlanningModel, group: Group,
                 settings: RequestSettings) -> None:
        super().__init__(settings)
        self._connection, self._model, self._group = connection, model, group
        self._end_effector_link = group.tip or ""
        self._reference_frame = model.frame
        self._random = np.random.default_rng()

    # -- the group --------------------------------------------------------------------------------------------------

    def get_name(self) -> str:
        """Return the group's name."""
        return self._group.name

    def get_active_joints(self) -> list[str]:
        """Return the names of the joints that can be moved, in the group's order."""
        return list(self._group.joints)

    def get_joints(self) -> list[str]:
        """Return the names of all joints of the group, fixed ones and those that mimic others, too."""
        return list(self._group.all_joints)

    def get_variable_count(self) -> int:
        """Return the number of joint values of the group, of joints that mimic others, too."""
        return len(self._group.valued_joints)

    def has_end_effector_link(self) -> bool:
        """Tell whether the group has a link that poses are for."""
        return bool(self._end_effector_link)

    def get_end_effector_link(self) -> str:
        """Return that link, "" where the group has none."""
        return self._end_effector_link

    def set_end_effector_link(self, link_name: str) -> None:
        """Make poses be for this link, attached object or "object/subframe" of one. Raises MoveItCommanderException for
        a name that is neither."""
        self._end_effector_link = self._known_link(link_name)

    def get_interface_description(self) -> PlannerInterfaceDescription:
        """Return the PlannerInterfaceDescription of the planning pipeline; an empty one where there is none."""
        found = self._connection.call("query_planner_interface").planner_interfaces
        wanted = self._settings.pipeline_id
        return next((one for one in found if wanted in ("", one.pipeline_id)), PlannerInterfaceDescription())

    def get_pose_reference_frame(self) -> str:
        """Return the frame that poses without one are in."""
        return self._reference_frame

    def set_pose_reference_frame(self, reference_frame: str) -> None:
        """Set the frame that poses without one are in."""
        self._reference_frame = reference_frame

    def get_planning_frame(self) -> str:
        """Return the frame that planning happens in."""
        return self._model.frame

    # -- where it is ------------------------------------------------------------------------------------------------

    def get_current_state(self) -> RobotState:
        """Return the RobotState now. Raises MoveItCommanderException when move_group does not know it."""
        return scene_calls.robot_state(self._connection)

    def get_current_state_bounded(self) -> RobotState:
        """Return the RobotState now, every joint within its limits."""
        return self.enforce_bounds(self.get_current_state())

    def get_current_joint_values(self) -> list[float]:
        """Return the joint values now, in the group's order, with those of joints that mimic others."""
        return self._values_of(self._state_now())

    def get_current_pose(self, end_effector_link: str = "") -> PoseStamped:
        """Return the PoseStamped of a link now, in the planning frame; the end effector's unless one is named."""
        return self._stamped(pose_of(self._frame_of(self._state_now(), end_effector_link)), self._model.frame)

    def get_current_rpy(self, end_effector_link: str = "") -> list[float]:
        """Return [roll, pitch, yaw] of a link now, in the planning frame."""
        return list(rpy_from_matrix(self._frame_of(self._state_now(), end_effector_link)))

    def get_random_joint_values(self) -> list[float]:
        """Return joint values within the limits, evenly spread, in the order of :meth:`get_current_joint_values`."""
        return self._values_of(self._random_state(self._model.default_state()))

    def get_random_pose(self, end_effector_link: str = "") -> PoseStamped:
        """Return the PoseStamped, in the planning frame, of a link at random joint values."""
        state = self._random_state(self._state_now())
        return self._stamped(pose_of(self._frame_of(state, end_effector_link)), self._model.frame)

    def _random_state(self, state: State) -> State:
        return state.with_q(random_values(self._model, self._group, self._random), self._group.indices)

    def _values_of(self, state: State) -> list[float]:
        return values_of(self._model, self._group, state.q)

    def _state_now(self) -> State:
        message = self.get_current_state()
        unknown = [name for name in self._group.joints if name not in message.joint_state.name]
        if unknown:
            raise MoveItCommanderException("move_group does not know where %s stand; does a node publish them on "
                                           "the joint states that it listens to?" % ", ".join(unknown))
        return states.state_of(self._model, message)

    def _frame_of(self, state: State, link: str) -> np.ndarray:
        link, within = self._link(link, "get the pose of"), np.eye(4)
        if link not in self._model.links:
            link, within = scene_calls.held_frame(self._connection, link)
        return self._model.frame_of(state.q, link, state.base) @ within

    def _link(self, link: str, purpose: str) -> str:
        """The link that a caller means; the end effector's where he names none."""
        if not link and not self._end_effector_link:
            raise MoveItCommanderException("There is no end effector to %s: group '%s' has no single tip; name a link"
                                           % (purpose, self._group.name))
        return self._known_link(link) if link else self._end_effector_link

    def _known_link(self, link: str) -> str:
        if link not in self._model.links:
            scene_calls.held_frame(self._connection, link)
        return link

    @staticmethod
    def _stamped(pose: Pose, frame: str) -> PoseStamped:
        message = PoseStamped(pose=pose)
        message.header.frame_id, message.header.stamp = frame, rospy.Time.now()
        return message

    def enforce_bounds(self, robot_state_msg: RobotState) -> RobotState:
        """Return the RobotState, every joint within its limits. Raises genpy.DeserializationError for an empty one."""
        if not robot_state_msg.joint_state.name and not robot_state_msg.multi_dof_joint_state.joint_names:
            raise genpy.DeserializationError("the robot state names no joints")
        state = states.state_of(self._model, robot_state_msg)
        result = states.message_of(self._model, state.with_q(within_limits(self._model, state.q)))
        result.attached_collision_objects = robot_state_msg.attached_collision_objects
        return result
