# SPDX-License-Identifier: BSD-3-Clause
"""The objects that MoveIt's commander wraps: they take and give messages as bytes and poses as lists.

Programs reach for them (``group._g``, ``robot._r``, ``scene._psi``). Here it is the other way round: they wrap the
commander. Every method that is not here is the commander's own of that name.
"""
from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import genpy
import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import (
    Constraints,
    Grasp,
    MoveItErrorCodes,
    PlaceLocation,
    PlanningScene,
    RobotState,
    RobotTrajectory,
    TrajectoryConstraints,
)
from sensor_msgs.msg import JointState

from .conversions import list_to_pose, list_to_pose_stamped, msg_from_string, msg_to_string, pose_to_list
from .exception import MoveItCommanderException

if TYPE_CHECKING:
    from .move_group import MoveGroupCommander
    from .planning_scene_interface import PlanningSceneInterface
    from .robot import RobotCommander


class _Wrapped:
    """Has all that its commander has, but for what is the commander's own."""

    def __init__(self, commander: MoveGroupCommander | RobotCommander | PlanningSceneInterface) -> None:
        self._commander: Any = commander

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._commander, name)


class WrappedGroup(_Wrapped):
    """``_g`` of a MoveGroupCommander. Methods that set something tell whether that was possible, and raise nothing."""

    # -- state ------------------------------------------------------------------------------------------------------

    def start_state_monitor(self, wait: float = 1.0) -> bool:
        """Tell whether move_group knows the group's joints; there is nothing to start, nor to wait for."""
        return _possible(self._commander.get_current_joint_values)

    def get_variables(self) -> list[str]:
        """Return the names of the group's joint values, in order."""
        return list(self._commander._group.valued_joints)

    def get_current_pose(self, end_effector_link: str = "") -> list[float]:
        """Return [x, y, z, qx, qy, qz, qw] of a link now, in the planning frame."""
        return pose_to_list(self._commander.get_current_pose(end_effector_link).pose)

    def get_random_pose(self, end_effector_link: str = "") -> list[float]:
        """Return [x, y, z, qx, qy, qz, qw] of a link at random joint values, in the planning frame."""
        return pose_to_list(self._commander.get_random_pose(end_effector_link).pose)

    def get_current_state(self) -> bytes:
        """Return the RobotState now."""
        return msg_to_string(self._commander.get_current_state())

    def get_current_state_bounded(self) -> dict[str, float]:
        """Return {joint: value} now, every joint within its limits."""
        state = self._commander.get_current_state_bounded().joint_state
        return dict(zip(state.name, state.position, strict=True))

    def enforce_bounds(self, state: bytes) -> bytes:
        """Return a RobotState, every joint within its limits. Raises genpy.DeserializationError for an empty one."""
        return msg_to_string(self._commander.enforce_bounds(_message(RobotState, state)))

    def set_start_state(self, state: bytes) -> None:
        """Plan from a RobotState."""
        self._commander.set_start_state(_message(RobotState, state))

    def get_interface_description(self) -> bytes:
        """Return the PlannerInterfaceDescription."""
        return msg_to_string(self._commander.get_interface_description())

    # -- targets ----------------------------------------------------------------------------------------------------

    def set_joint_value_target(self, *target: Any) -> bool:
        """Set joint values: a list, {joint: value}, or a joint and its value."""
        return _possible(self._commander.set_joint_value_target, *target)

    def set_joint_value_target_from_pose(self, pose: bytes, end_effector_link: str, approximate: bool) -> bool:
        """Set the joint values of a Pose."""
        return _possible(self._commander.set_joint_value_target, _message(Pose, pose), end_effector_link, approximate)

    def set_joint_value_target_from_pose_stamped(self, pose: bytes, end_effector_link: str, approximate: bool) -> bool:
        """Set the joint values of a PoseStamped."""
        return _possible(self._commander.set_joint_value_target, _message(PoseStamped, pose), end_effector_link,
                         approximate)

    def set_joint_value_target_from_joint_state_message(self, state: bytes) -> bool:
        """Set the joint values of a JointState."""
        return _possible(self._commander.set_joint_value_target, _message(JointState, state))

    def set_named_target(self, name: str) -> bool:
        """Set a remembered or a named state."""
        return _possible(self._commander.set_named_target, name)

    def set_pose_target(self, pose: Sequence[float], end_effector_link: str = "") -> bool:
        """Set a pose of 6 or 7 values."""
        return _possible(self._commander.set_pose_target, pose, end_effector_link)

    def set_pose_targets(self, poses: Sequence[Sequence[float]], end_effector_link: str = "") -> bool:
        """Set poses of 6 or 7 values, one of which is to be reached."""
        return _possible(self._commander.set_pose_targets, poses, end_effector_link)

    def set_position_target(self, x: float, y: float, z: float, end_effector_link: str = "") -> bool:
        """Set a position [m]."""
        return _possible(self._commander.set_position_target, [x, y, z], end_effector_link)

    def set_rpy_target(self, roll: float, pitch: float, yaw: float, end_effector_link: str = "") -> bool:
        """Set an orientation [rad]."""
        return _possible(self._commander.set_rpy_target, [roll, pitch, yaw], end_effector_link)

    def set_orientation_target(self, x: float, y: float, z: float, w: float, end_effector_link: str = "") -> bool:
        """Set an orientation, a quaternion."""
        return _possible(self._commander.set_orientation_target, [x, y, z, w], end_effector_link)

    def set_end_effector_link(self, link: str) -> bool:
        """Make poses be for this link."""
        return _possible(self._commander.set_end_effector_link, link)

    # -- settings ---------------------------------------------------------------------------------------------------

    def set_path_constraints(self, name: str) -> bool:
        """Tell that there are no stored constraints of this name."""
        return _possible(self._commander.set_path_constraints, name)

    def set_path_constraints_from_msg(self, constraints: bytes) -> None:
        """Set the Constraints that hold on the way."""
        self._commander.set_path_constraints(_message(Constraints, constraints))

    def get_path_constraints(self) -> bytes:
        """Return the Constraints that hold on the way."""
        return msg_to_string(self._commander.get_path_constraints())

    def set_trajectory_constraints_from_msg(self, constraints: bytes) -> None:
        """Set the TrajectoryConstraints."""
        self._commander.set_trajectory_constraints(_message(TrajectoryConstraints, constraints))

    def get_trajectory_constraints(self) -> bytes:
        """Return the TrajectoryConstraints."""
        return msg_to_string(self._commander.get_trajectory_constraints())

    def set_workspace(self, *limits: float) -> None:
        """Set where a base that can move may go: min x, min y, min z, max x, max y, max z [m]."""
        self._commander.set_workspace(limits)

    # -- plan and move ----------------------------------------------------------------------------------------------

    def move(self) -> bool:
        """Plan and move; tell whether that succeeded."""
        return self._commander.go(wait=True)

    def async_move(self) -> bool:
        """Plan and move, and do not wait."""
        return self._commander.go(wait=False)

    def plan(self) -> tuple[bytes, bytes, float]:
        """Return (MoveItErrorCodes, RobotTrajectory, planning time [s])."""
        _, trajectory, seconds, code = self._commander.plan()
        return msg_to_string(code), msg_to_string(trajectory), seconds

    def construct_motion_plan_request(self) -> bytes:
        """Return the MotionPlanRequest that plan() would send."""
        return msg_to_string(self._commander.construct_motion_plan_request())

    def execute(self, trajectory: bytes) -> bool:
        """Execute a RobotTrajectory; tell whether that succeeded."""
        return self._commander.execute(_message(RobotTrajectory, trajectory), wait=True)

    def async_execute(self, trajectory: bytes) -> bool:
        """Execute a RobotTrajectory, and do not wait."""
        return self._commander.execute(_message(RobotTrajectory, trajectory), wait=False)

    def compute_cartesian_path(self, waypoints: Iterable[Sequence[float]], eef_step: float,
                               jump_threshold: float | bool = 0.0, avoid_collisions: bool | bytes = True,
                               path_constraints: bytes = b"") -> tuple[bytes, float]:
        """Return (RobotTrajectory, fraction) through poses of 6 or 7 values; ``jump_threshold`` may be left out."""
        if isinstance(avoid_collisions, bytes):
            avoid_collisions, path_constraints = True, avoid_collisions
        constraints = _message(Constraints, path_constraints) if path_constraints else None
        trajectory, fraction = self._commander.compute_cartesian_path(
            map(list_to_pose, waypoints), eef_step, jump_threshold, avoid_collisions, constraints)
        return msg_to_string(trajectory), fraction

    def retime_trajectory(self, state: bytes, trajectory: bytes, velocity_scaling_factor: float,
                          acceleration_scaling_factor: float, algorithm: str) -> bytes:
        """Return a RobotTrajectory with new times."""
        return msg_to_string(self._commander.retime_trajectory(
            _message(RobotState, state), _message(RobotTrajectory, trajectory), velocity_scaling_factor,
            acceleration_scaling_factor, algorithm))

    # -- objects ----------------------------------------------------------------------------------------------------

    def pick(self, object_name: str, *options: Any) -> int:
        """Grasp an object, by a Grasp or a list of them; the last option may be whether it is only planned."""
        given, plan_only = _options(options)
        grasps = [given] if isinstance(given, bytes) else given or []
        return self._commander.pick(object_name, [_message(Grasp, grasp) for grasp in grasps], plan_only)

    def place(self, object_name: str, *options: Any) -> bool:
        """Put an object down at a pose of 7 values or a PlaceLocation, or anywhere."""
        where, plan_only = _options(options)
        if isinstance(where, bytes):
            where = _message(PlaceLocation, where)
        elif where is not None:
            where = list_to_pose_stamped(where, self._commander.get_pose_reference_frame())
        return self._commander.place(object_name, where, plan_only) == MoveItErrorCodes.SUCCESS

    def place_poses_list(self, object_name: str, poses: Iterable[bytes], plan_only: bool = False) -> bool:
        """Put an object down at one of several PoseStampeds."""
        where = [_message(PoseStamped, pose) for pose in poses]
        return self._commander.place(object_name, where, plan_only) == MoveItErrorCodes.SUCCESS

    def place_locations_list(self, object_name: str, locations: Iterable[bytes], plan_only: bool = False) -> bool:
        """Put an object down at one of several PlaceLocations."""
        where = [_message(PlaceLocation, location) for location in locations]
        return self._commander.place(object_name, where, plan_only) == MoveItErrorCodes.SUCCESS


class WrappedRobot(_Wrapped):
    """``_r`` of a RobotCommander. Unknown names give empty lists."""

    def __getattr__(self, name: str) -> Any:
        # A robot's groups, joints and links are attributes of the commander alone.
        if name.startswith("_") or not hasattr(type(self._commander), name):
            raise AttributeError(name)
        return getattr(self._commander, name)

    def get_robot_name(self) -> str:
        """Return the name in the URDF."""
        return self._commander._model.name

    def get_robot_root_link(self) -> str:
        """Return the root link."""
        return self._commander.get_root_link()

    def get_group_joint_names(self, group: str) -> list[str]:
        """Return the joints of a group, fixed ones and those that mimic others, too."""
        return self._of_group(group, self._commander.get_joint_names)

    def get_group_active_joint_names(self, group: str) -> list[str]:
        """Return the joints of a group that can be moved."""
        return self._of_group(group, self._commander.get_active_joint_names)

    def get_group_link_names(self, group: str) -> list[str]:
        """Return the links of a group."""
        return self._of_group(group, self._commander.get_link_names)

    def get_group_joint_tips(self, group: str) -> list[str]:
        """Return the tip of a group that has one."""
        return self._of_group(group, lambda name: [self._group(name).tip] if self._group(name).tip else [])

    def get_group_default_states(self, group: str) -> list[str]:
        """Return the names of a group's states in the SRDF."""
        return self._of_group(group, lambda name: list(self._group(name).states))

    def get_joint_values(self, group: str, state: str) -> dict[str, float]:
        """Return {joint: value} of a group's state in the SRDF, {} where there is none of this name."""
        return dict(self._group(group).states.get(state, {})) if self._commander.has_group(group) else {}

    def get_parent_group(self, group: str) -> tuple[str, str]:
        """Return (group, link) that a group of an end effector is mounted on, ("", "") for another group."""
        effector = self._group(group).end_effector if self._commander.has_group(group) else None
        return (effector.parent_group or "", effector.parent_link) if effector is not None else ("", "")

    def get_joint_limits(self, name: str) -> list[list[float | None]]:
        """Return [[lower, upper]] of a joint, [] for one without a value of its own."""
        bounds = self._commander.bounds_of(name)
        return [bounds] if bounds else []

    def get_current_joint_values(self, name: str) -> list[float]:
        """Return the values of a joint now."""
        value = self._commander.value_of(name)
        return list(value) if isinstance(value, list) else [value]

    def get_link_pose(self, name: str) -> list[float]:
        """Return [x, y, z, qx, qy, qz, qw] of a link now, in the planning frame."""
        return pose_to_list(self._commander.pose_of(name).pose) if name in self._commander.get_link_names() else []

    def get_current_state(self) -> bytes:
        """Return the RobotState now."""
        return msg_to_string(self._commander.get_current_state())

    def get_robot_markers(self, *args: Any) -> bytes:
        """Return a MarkerArray that draws the robot; a RobotState among ``args`` is given as bytes."""
        return msg_to_string(self._commander.get_robot_markers(
            *(_message(RobotState, one) if isinstance(one, bytes) else one for one in args)))

    def get_group_markers(self, group: str, *args: Any) -> bytes:
        """Return a MarkerArray that draws a group."""
        return self.get_robot_markers(group, *args)

    def _group(self, name: str) -> Any:
        return self._commander._model.groups[name]

    def _of_group(self, name: str, names: Callable[[str], list[str]]) -> list[str]:
        return names(name) if self._commander.has_group(name) else []


class WrappedScene(_Wrapped):
    """``_psi`` of a PlanningSceneInterface."""

    def get_object_poses(self, names: Sequence[str]) -> dict[str, bytes]:
        """Return {name: Pose} of objects in the world."""
        return _as_bytes(self._commander.get_object_poses(names))

    def get_objects(self, names: Sequence[str] = ()) -> dict[str, bytes]:
        """Return {name: CollisionObject} of objects in the world."""
        return _as_bytes(self._commander.get_objects(names))

    def get_attached_objects(self, names: Sequence[str] = ()) -> dict[str, bytes]:
        """Return {name: AttachedCollisionObject} of what the robot holds."""
        return _as_bytes(self._commander.get_attached_objects(names))

    def get_planning_scene(self, components: int) -> bytes:
        """Return a PlanningScene."""
        return msg_to_string(self._commander.get_planning_scene(components))

    def apply_planning_scene(self, scene: bytes) -> bool:
        """Apply a PlanningScene."""
        return self._commander.apply_planning_scene(_message(PlanningScene, scene))


def _message(kind: type[genpy.Message], data: bytes) -> Any:
    """A message of bytes; one that is a message already as it is. Raises genpy.DeserializationError."""
    if isinstance(data, genpy.Message):
        return data
    message = kind()
    msg_from_string(message, data)
    return message


def _as_bytes(messages: dict[str, genpy.Message]) -> dict[str, bytes]:
    return {name: msg_to_string(message) for name, message in messages.items()}


def _options(options: Sequence[Any]) -> tuple[Any, bool]:
    """(what was given before, whether the last option is a true bool)."""
    plan_only = bool(options) and isinstance(options[-1], bool)
    given = options[:-1] if plan_only else options
    return (given[0] if given else None), plan_only and options[-1]


def _possible(function: Callable[..., object], *values: Any) -> bool:
    """Call a function; tell whether it raised nothing. What it raised is logged."""
    try:
        function(*values)
    except MoveItCommanderException as error:
        rospy.logwarn("%s", error)
        return False
    return True
