# SPDX-License-Identifier: BSD-3-Clause
"""Plans and moves one group of joints."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import genpy
import numpy as np
import rospy
from geometry_msgs.msg import Pose, PoseStamped
from moveit_msgs.msg import (
    CollisionObject,
    Constraints,
    ExecuteTrajectoryGoal,
    MoveItErrorCodes,
    PlannerInterfaceDescription,
    RobotState,
    RobotTrajectory,
)
from std_msgs.msg import String

from urdf_model.transforms import rpy_from_matrix

from . import requests, scene_calls, states
from .connection import connect
from .conversions import pose_of
from .description import load
from .exception import MoveItCommanderException
from .plan import Plan, trajectory_of
from .requests import JOINTS, RequestSettings, code_name
from .retiming import retimed
from .targeting import Targeting
from .targets import JointTarget, jacobian, random_values, values_of, within_limits
from .wrapped import WrappedGroup

if TYPE_CHECKING:
    from moveit_msgs.msg import Grasp, MotionPlanRequest, MoveGroupGoal, PickupGoal, PlaceGoal

    from motion_planning.model import State
    from moveit_commander.plan import Motion
    from moveit_commander.targeting import JointsLike, PoseLike

__all__ = ["MoveGroupCommander"]

_OPTIONAL_ACTION_WAIT_S = 5.0


class MoveGroupCommander(Targeting):
    """Commander of one group of the robot. Positions in m, angles in rad, times in s, quaternions x, y, z, w.

    name: the group, as the SRDF has it. robot_description: parameter with the URDF; SRDF, limits and settings lie
    beside it. ns: namespace of move_group. wait_for_servers: how long its actions are waited for.
    Raises RuntimeError for an unknown group, without a description, and when the actions do not come.
    """

    def __init__(self, name: str, robot_description: str = "robot_description", ns: str = "",
                 wait_for_servers: float = 5.0) -> None:
        self._connection = connect(ns)
        description = load(robot_description, ns)
        self._model = description.model
        if name not in self._model.groups:
            raise RuntimeError("Group '%s' was not found; the robot has %s"
                               % (name, ", ".join(self._model.groups) or "no groups"))
        self._group = self._model.groups[name]
        self._connection.advertise("trajectory_execution_event")
        self._connection.wait_for_actions(["move_group", "execute_trajectory"], wait_for_servers)
        own = description.kinematics.get(name) or {}
        super().__init__(RequestSettings(
            velocity_scaling=description.velocity_scaling, acceleration_scaling=description.acceleration_scaling,
            **{key + "_tolerance": float(own["goal_%s_tolerance" % key])
               for key in ("joint", "position", "orientation") if "goal_%s_tolerance" % key in own}))
        self._end_effector_link = self._group.tip or ""
        self._reference_frame = self._model.frame
        self._joint_target = JointTarget(self._model, self._group)
        self._pose_targets = {}
        self._kind = JOINTS
        self._remembered = {}
        self._random = np.random.default_rng()
        # MoveIt's commander is made of this object, and programs use it.
        self._g = WrappedGroup(self)

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

    def get_named_targets(self) -> list[str]:
        """Return the names of the SRDF's states of this group, and of remembered joint values."""
        return [*self._group.states, *(name for name in self._remembered if name not in self._group.states)]

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

    # -- start ------------------------------------------------------------------------------------------------------

    def set_start_state_to_current_state(self) -> None:
        """Plan from the robot's state at the time of planning."""
        self._settings.start_state = None

    def set_start_state(self, msg: RobotState) -> None:
        """Plan from this RobotState. Joints without a value in it keep their state at the time of planning."""
        names = msg.joint_state.name
        partial = any(name not in names for name in self._model.variables)
        self._settings.start_state = RobotState(
            joint_state=msg.joint_state, multi_dof_joint_state=msg.multi_dof_joint_state,
            attached_collision_objects=msg.attached_collision_objects, is_diff=msg.is_diff or partial)

    # -- plan and move ----------------------------------------------------------------------------------------------

    def construct_motion_plan_request(self) -> MotionPlanRequest:
        """Return the MotionPlanRequest that plan() would send."""
        if self._kind == JOINTS:
            goals = [requests.joint_goal(self._group.joints, self._joint_target.moved(),
                                         self.get_goal_joint_tolerance())]
        else:
            goals = requests.pose_goals(self._pose_targets, self._kind, self._settings)
        return requests.motion_plan_request(self._group.name, self._model.frame, goals, self._settings)

    def go(self, joints: JointsLike | PoseLike | bool | None = None, wait: bool = True) -> bool:
        """Plan and move; tell whether that succeeded, without waiting whether it was sent.

        joints: what to reach if not the target that is set: joint values, {joint: value}, JointState, Pose, or the name
        of a state. A bool alone is ``wait``.
        """
        if isinstance(joints, bool):
            joints, wait = None, joints
        goal = self._goal(joints, plan_only=False)
        if not wait:
            self._connection.start("move_group", goal)
            return True
        return self._ended("move_group", goal).error_code.val == MoveItErrorCodes.SUCCESS

    def plan(self, joints: JointsLike | PoseLike | None = None) -> Plan:
        """Plan, as :meth:`go` does; return (success, RobotTrajectory, planning time, MoveItErrorCodes).

        The tuple can be used as the trajectory itself, too (:class:`Plan`).
        """
        result = self._ended("move_group", self._goal(joints, plan_only=True))
        return Plan((result.error_code.val == MoveItErrorCodes.SUCCESS, result.planned_trajectory, result.planning_time,
                     result.error_code))

    def _goal(self, joints: JointsLike | PoseLike | None, plan_only: bool) -> MoveGroupGoal:
        if isinstance(joints, Pose | PoseStamped):
            self.set_pose_target(joints)
        elif isinstance(joints, str):
            self.set_named_target(joints)
        elif joints is not None:
            self.set_joint_value_target(joints)
        return requests.move_group_goal(self.construct_motion_plan_request(), self._settings, plan_only)

    def _ended(self, action: str, goal: genpy.Message) -> Any:
        """The result of a goal; a failure's cause is logged, and what a success was told beside MoveIt's sentence."""
        result, text = self._connection.run(action, goal)
        code = result.error_code.val
        if code != MoveItErrorCodes.SUCCESS:
            rospy.logwarn("%s of group '%s' failed: %s (%s)", action, self._group.name, text or "no reason given",
                          code_name(code))
        elif text.partition(". ")[2]:
            rospy.logwarn("%s of group '%s': %s", action, self._group.name, text.partition(". ")[2])
        return result

    def compute_cartesian_path(self, waypoints: Iterable[PoseLike], eef_step: float, jump_threshold: float | bool = 0.0,
                               avoid_collisions: bool | Constraints = True,
                               path_constraints: Constraints | None = None) -> tuple[RobotTrajectory, float]:
        """Return (RobotTrajectory, fraction) along straight lines through ``waypoints`` (Poses in the reference frame).

        eef_step: largest distance between two points. jump_threshold: largest step of the joints, as a multiple of
        the mean one; 0 for no check; it may be left out. fraction: of the path that is possible, -1 for an error.
        """
        if isinstance(jump_threshold, bool):
            shifted = avoid_collisions if isinstance(avoid_collisions, Constraints) else path_constraints
            jump_threshold, avoid_collisions, path_constraints = 0.0, jump_threshold, shifted
        fields = {"group_name": self._group.name, "link_name": self._end_effector_link, "max_step": float(eef_step),
                  "waypoints": [self._in_reference_frame(pose).pose for pose in waypoints],
                  "jump_threshold": float(jump_threshold), "avoid_collisions": bool(avoid_collisions),
                  "path_constraints": path_constraints or Constraints(),
                  "header": self._stamped(Pose(), self._reference_frame).header, "start_state": RobotState(),
                  "cartesian_speed_limited_link": self._settings.cartesian_speed_link,
                  "max_cartesian_speed": self._settings.cartesian_speed}
        requests.set_start(fields["start_state"], self._settings)
        answer = self._connection.call("compute_cartesian_path", **fields)
        if answer.error_code.val != MoveItErrorCodes.SUCCESS:
            rospy.logwarn("no Cartesian path of group '%s': %s", self._group.name,
                          code_name(answer.error_code.val))
            return RobotTrajectory(), -1.0
        return answer.solution, answer.fraction

    def execute(self, trajectory: Motion | None = None, wait: bool = True, plan_msg: Motion | None = None) -> bool:
        """Execute a RobotTrajectory, JointTrajectory or plan; tell whether that succeeded, or was sent.

        plan_msg: melodic's name of ``trajectory``.
        """
        goal = ExecuteTrajectoryGoal(trajectory_of(plan_msg if trajectory is None else trajectory))
        if not wait:
            self._connection.start("execute_trajectory", goal)
            return True
        return self._ended("execute_trajectory", goal).error_code.val == MoveItErrorCodes.SUCCESS

    def stop(self) -> None:
        """Stop moving: the present execution of move_group, and the requests of this program."""
        self._connection.publish("trajectory_execution_event", String("stop"))
        self._connection.cancel()

    # -- objects ----------------------------------------------------------------------------------------------------

    def attach_object(self, object_name: str, link_name: str = "", touch_links: Iterable[str] = ()) -> bool:
        """Attach an object of the scene to a link, the end effector's unless one is named; tell whether that was done.

        touch_links: links that may touch it, the carrying one unless some are named.
        """
        link = link_name or self._end_effector_link or self._group.links[0]
        return scene_calls.attach(self._connection, scene_calls.attached_object(
            object_name, link, CollisionObject.ADD, touch_links or [link]))

    def detach_object(self, name: str = "") -> bool:
        """Put an object, or all that a link holds, or all that the group holds, back into the scene."""
        if name:
            what = [("", name)] if name not in self._model.links else [(name, "")]
        else:
            held = self.get_current_state().attached_collision_objects
            what = [(one.link_name, one.object.id) for one in held if one.link_name in self._group.moving_links]
        done = [scene_calls.attach(self._connection, scene_calls.attached_object(
            object_name, link, CollisionObject.REMOVE)) for link, object_name in what]
        return all(done)

    def pick(self, object_name: str, grasp: Grasp | str | Iterable[Grasp | str] = (), plan_only: bool = False) -> int:
        """Grasp an object, by a Grasp or one of a list; return a number of MoveItErrorCodes."""
        goal = requests.pickup_goal(self._group, object_name, requests.grasps_of(grasp), self._settings, plan_only)
        return self._handle("pickup", goal)

    def place(self, object_name: str, location: Any = None, plan_only: bool = False) -> int:
        """Put an object down: at a Pose, PoseStamped, PlaceLocation, one of a list of these, or anywhere (None).

        Returns a number of MoveItErrorCodes.
        """
        places = requests.place_locations(location, self._reference_frame, self._model.root, self._end_effector_link)
        return self._handle("place", requests.place_goal(self._group, object_name, places, self._settings, plan_only))

    def _handle(self, action: str, goal: PickupGoal | PlaceGoal) -> int:
        self._connection.wait_for_actions([action], _OPTIONAL_ACTION_WAIT_S)
        return self._ended(action, goal).error_code.val

    def set_support_surface_name(self, value: str) -> None:
        """Name the support surface of objects to pick up and place."""
        self._settings.support_surface = value

    # -- computations -----------------------------------------------------------------------------------------------

    def retime_trajectory(self, ref_state_in: RobotState, traj_in: RobotTrajectory,
                          velocity_scaling_factor: float = 1.0, acceleration_scaling_factor: float = 1.0,
                          algorithm: str = "iterative_time_parameterization") -> RobotTrajectory:
        """Return a RobotTrajectory along the same points with new times; empty for an unknown algorithm.

        algorithm: also "iterative_spline_parameterization" and "time_optimal_trajectory_generation".
        """
        return retimed(self._model, trajectory_of(traj_in), (velocity_scaling_factor, acceleration_scaling_factor),
                       algorithm)

    def get_jacobian_matrix(self, joint_values: Sequence[float],
                            reference_point: Sequence[float] | None = None) -> np.ndarray:
        """Return the Jacobian (6, k), linear above angular, in the frame of the group's base.

        reference_point: a point in the tip's frame, its origin unless one is given.
        """
        return jacobian(self._group, joint_values, (0.0, 0.0, 0.0) if reference_point is None else reference_point)

    def enforce_bounds(self, robot_state_msg: RobotState) -> RobotState:
        """Return the RobotState, every joint within its limits. Raises genpy.DeserializationError for an empty one."""
        if not robot_state_msg.joint_state.name and not robot_state_msg.multi_dof_joint_state.joint_names:
            raise genpy.DeserializationError("the robot state names no joints")
        state = states.state_of(self._model, robot_state_msg)
        result = states.message_of(self._model, state.with_q(within_limits(self._model, state.q)))
        result.attached_collision_objects = robot_state_msg.attached_collision_objects
        return result
