# SPDX-License-Identifier: BSD-3-Clause
"""Targets of a group of joints: joint values, poses, names."""
from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import (
    MoveItErrorCodes,
    PositionIKRequest,
    RobotState,
)
from sensor_msgs.msg import JointState

from arm_kinematics import NoSolution, solve
from command_line.options import counted
from urdf_model.transforms import rpy_from_matrix, rpy_matrix

from . import states
from .conversions import list_to_pose, matrix_of, pose_of, pose_to_list
from .exception import MoveItCommanderException
from .group_state import GroupQueries
from .requests import JOINTS, ORIENTATION, POSE, POSITION, code_name
from .targets import JointValueTarget, with_followers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from geometry_msgs.msg import Point, Quaternion

    from motion_planning.model import Group, PlanningModel

    from .connection import MoveGroupConnection
    from .requests import RequestSettings

    PoseLike = Pose | PoseStamped | Sequence[float]
    ManyJointsLike = Mapping[str, float] | JointState | RobotState | Sequence[float] | np.ndarray
    JointsLike = str | ManyJointsLike


class Targeting(GroupQueries):
    """The methods of MoveGroupCommander that set targets."""

    def __init__(self, connection: MoveGroupConnection, model: PlanningModel, group: Group,
                 settings: RequestSettings) -> None:
        super().__init__(connection, model, group, settings)
        self._joint_target = JointValueTarget(model, group)
        self._pose_targets: dict[str, list[PoseStamped]] = {}
        self._kind = JOINTS
        self._remembered: dict[str, list[float]] = {}

    # -- targets: joints --------------------------------------------------------------------------------------------

    def get_joint_value_target(self) -> list[float]:
        """Return the target's joint values, in the order of :meth:`get_current_joint_values`."""
        return self._joint_target.values()

    def set_joint_value_target(self, arg1: JointsLike | Pose | PoseStamped, arg2: Any = None,
                               arg3: bool | None = None) -> None:
        """Set the joint values to reach; a pose is turned into joint values at once.

        arg1: values in the group's order; {joint: value}; a JointState or RobotState; a joint's name, with its value as
        arg2; a Pose or PoseStamped, with a link's name and whether the nearest pose will do (bool) as arg2 and arg3.
        Raises MoveItCommanderException for values beyond the limits, names that are not there, poses out of reach.
        """
        if isinstance(arg1, Pose | PoseStamped):
            options = [option for option in (arg2, arg3) if option is not None]
            if not all(isinstance(option, str | bool) for option in options):
                raise MoveItCommanderException("beside a pose, expected a link's name (str) and whether the nearest "
                                               "pose will do (bool), got %r" % (options,))
            link = next((option for option in options if isinstance(option, str)), "")
            self._set_joints_at(arg1, link, any(option is True for option in options))
        elif isinstance(arg1, str):
            if arg2 is None or arg3 is not None or np.size(arg2) != 1:
                raise MoveItCommanderException("expected one value for joint '%s'" % arg1)
            value, = [arg2] if np.ndim(arg2) == 0 else arg2
            self._joint_target.set_by_name({arg1: value}, self._settings.joint_tolerance)
        elif arg2 is not None or arg3 is not None:
            raise MoveItCommanderException("expected joint values alone, got more: %r, %r" % (arg2, arg3))
        else:
            self._set_joints(arg1)
        self._kind = JOINTS

    def _set_joints(self, values: ManyJointsLike) -> None:
        tolerance = self._settings.joint_tolerance
        if isinstance(values, RobotState | JointState):
            joints = values.joint_state if isinstance(values, RobotState) else values
            self._joint_target.set_robot(states.named_positions(joints), tolerance)
        elif isinstance(values, Mapping):
            self._joint_target.set_by_name(values, tolerance)
        else:
            self._joint_target.set_values(values, tolerance)

    def _set_joints_at(self, pose: Pose | PoseStamped, link: str, nearest: bool) -> None:
        link = self._link(link, "set the pose for")
        stamped = self._in_reference_frame(pose)
        request = PositionIKRequest(group_name=self._group.name, ik_link_name=link, pose_stamped=stamped)
        request.robot_state = states.message_of(
            self._model, self._state_now().with_q(self._joint_target.moved(), self._group.indices))
        answer = self._connection.call("compute_ik", ik_request=request)
        if answer.error_code.val == MoveItErrorCodes.SUCCESS:
            solution = states.named_positions(answer.solution.joint_state)
            values = {name: solution[name] for name in self._group.joints}
        elif nearest:
            values = dict(zip(self._group.joints, self._nearest(stamped, link), strict=True))
        else:
            raise MoveItCommanderException("Error setting joint target: no joint values put '%s' at %s in '%s' (%s)" % (
                link, ["%.4g" % value for value in pose_to_list(stamped.pose)], stamped.header.frame_id,
                code_name(answer.error_code.val)))
        self._joint_target.set_by_name(values, self._settings.joint_tolerance)

    def _nearest(self, stamped: PoseStamped, link: str) -> np.ndarray:
        """Joint values (k,) that bring the group's tip nearest to a pose in the frame of a link of the robot."""
        chain, frame = self._group.chain, stamped.header.frame_id
        if chain is None or link != self._group.tip or frame not in (*self._model.links, self._model.frame):
            raise MoveItCommanderException(
                "the nearest pose can be found for the tip of a chain alone, in the frame of a link; got link '%s' of "
                "group '%s' in '%s'" % (link, self._group.name, frame))
        now = self._state_now()
        frames = [np.eye(4) if name == self._model.frame else self._model.frame_of(now.q, name, now.base)
                  for name in (chain.base, frame)]
        target = np.linalg.inv(frames[0]) @ frames[1] @ matrix_of(stamped.pose)
        try:
            return solve(chain, target, seed=np.clip(now.q[self._group.indices], chain.lower, chain.upper)).q
        except NoSolution as failure:
            return failure.best

    def set_random_target(self) -> None:
        """Set random joint values as the target."""
        self.set_joint_value_target(self.get_random_joint_values())

    def set_named_target(self, name: str) -> None:
        """Set a remembered or a named state as the target. Raises MoveItCommanderException for an unknown name."""
        self.set_joint_value_target(self.get_named_target_values(name))

    def get_named_targets(self) -> list[str]:
        """Return the names of the SRDF's states of this group, and of remembered joint values."""
        return [*self._group.states, *(name for name in self._remembered if name not in self._group.states)]

    def get_named_target_values(self, target: str) -> dict[str, float]:
        """Return {joint: value} of a remembered or named state. Raises MoveItCommanderException for an unknown name."""
        if target in self._remembered:
            return dict(zip(self._group.valued_joints, self._remembered[target], strict=True))
        if target not in self._group.states:
            raise MoveItCommanderException("group '%s' has no state '%s'; it has %s" % (
                self._group.name, target, ", ".join(self.get_named_targets()) or "none"))
        return with_followers(self._model, self._group, self._group.states[target])

    def remember_joint_values(self, name: str, values: Sequence[float] | None = None) -> None:
        """Remember joint values, those of now unless some are given, under a name."""
        values = list(values) if values is not None else self.get_current_joint_values()
        if len(values) != self.get_variable_count():
            raise MoveItCommanderException("group '%s' has %s, got %s"
                                           % (self._group.name, counted(self.get_variable_count(), "joint"),
                                              counted(len(values), "value")))
        self._remembered[name] = values

    def get_remembered_joint_values(self) -> dict[str, list[float]]:
        """Return {name: values}."""
        return dict(self._remembered)

    def forget_joint_values(self, name: str) -> None:
        """Forget what was remembered under a name."""
        self._remembered.pop(name, None)

    # -- targets: poses ---------------------------------------------------------------------------------------------

    def set_pose_target(self, pose: PoseLike, end_effector_link: str = "") -> None:
        """Set the pose of a link to reach: Pose, PoseStamped, or x, y, z and roll, pitch, yaw or a quaternion."""
        self.set_pose_targets([pose], end_effector_link)

    def set_pose_targets(self, poses: Sequence[PoseLike], end_effector_link: str = "") -> None:
        """Set poses of a link, one of which is to be reached. Poses of other links stay targets besides."""
        link = self._link(end_effector_link, "set the pose for")
        poses = [self._in_reference_frame(pose) for pose in poses]
        if not poses:
            raise MoveItCommanderException("expected a pose for link '%s', got none" % link)
        self._pose_targets[link], self._kind = poses, POSE

    def set_rpy_target(self, rpy: Sequence[float], end_effector_link: str = "") -> None:
        """Set the orientation of a link to reach, [roll, pitch, yaw]."""
        if len(rpy) != 3:
            raise MoveItCommanderException("expected roll, pitch and yaw, got %s" % counted(len(rpy), "value"))
        turn = np.eye(4)
        turn[:3, :3] = rpy_matrix(*rpy)
        self._set_part(ORIENTATION, end_effector_link, orientation=pose_of(turn).orientation)

    def set_orientation_target(self, q: Sequence[float], end_effector_link: str = "") -> None:
        """Set the orientation of a link to reach, a quaternion [x, y, z, w]."""
        if len(q) != 4:
            raise MoveItCommanderException("expected a quaternion x, y, z, w, got %s" % counted(len(q), "value"))
        self._set_part(ORIENTATION, end_effector_link, orientation=list_to_pose([0.0, 0.0, 0.0, *q]).orientation)

    def set_position_target(self, xyz: Sequence[float], end_effector_link: str = "") -> None:
        """Set the position of a link to reach, [x, y, z]; any orientation will do."""
        if len(xyz) != 3:
            raise MoveItCommanderException("expected x, y, z, got %s" % counted(len(xyz), "value"))
        self._set_part(POSITION, end_effector_link, position=list_to_pose([*xyz, 0.0, 0.0, 0.0]).position)

    def _set_part(self, kind: str, link: str, **part: Point | Quaternion) -> None:
        link = self._link(link, "set the %s for" % kind)
        targets = self._pose_targets.get(link)
        pose = targets[0] if targets else self._in_reference_frame([0.0] * 6)
        fields = {"position": pose.pose.position, "orientation": pose.pose.orientation, **part}
        self._pose_targets[link], self._kind = [PoseStamped(header=pose.header, pose=Pose(**fields))], kind

    def _in_reference_frame(self, pose: PoseLike) -> PoseStamped:
        """A PoseStamped as it is; a Pose or a list in the reference frame."""
        if isinstance(pose, PoseStamped):
            if pose.header.frame_id:
                return pose
            pose = pose.pose
        return self._stamped(pose if isinstance(pose, Pose) else list_to_pose(pose), self._reference_frame)

    def shift_pose_target(self, axis: int, value: float, end_effector_link: str = "") -> None:
        """Set the pose now, shifted along axis 0 to 2 [m] or with roll, pitch or yaw (3 to 5) changed [rad]."""
        if axis not in range(6):
            raise MoveItCommanderException("expected an axis from 0 to 5, got %r" % (axis,))
        frame = self._frame_of(self._state_now(), end_effector_link)
        values = [*frame[:3, 3].tolist(), *rpy_from_matrix(frame)]
        values[axis] += value
        self.set_pose_target(self._stamped(list_to_pose(values), self._model.frame), end_effector_link)

    def clear_pose_target(self, end_effector_link: str) -> None:
        """Forget the poses of a link."""
        self._pose_targets.pop(end_effector_link or self._end_effector_link, None)

    def clear_pose_targets(self) -> None:
        """Forget all poses to reach."""
        self._pose_targets.clear()

    def limit_max_cartesian_link_speed(self, speed: float, link_name: str = "") -> None:
        """Limit the speed of a link [m/s], the end effector's unless one is named."""
        if not speed > 0.0:
            raise MoveItCommanderException("expected a speed above 0, got %s" % speed)
        self._settings.cartesian_speed = float(speed)
        self._settings.cartesian_speed_link = self._link(link_name, "limit the speed of")

    def clear_max_cartesian_link_speed(self) -> None:
        """Limit no link's speed."""
        self._settings.cartesian_speed, self._settings.cartesian_speed_link = 0.0, ""
