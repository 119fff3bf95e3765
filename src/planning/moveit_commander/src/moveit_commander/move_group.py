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
    RobotState,
    RobotTrajectory,
)
from std_msgs.msg import String

from . import requests, scene_calls
from .connection import connect
from .description import load
from .plan import PlanTuple, trajectory_of
from .requests import JOINTS, RequestSettings, code_name
from .retiming import retimed
from .targeting import Targeting
from .targets import jacobian
from .wrapped import WrappedGroup

if TYPE_CHECKING:
    from moveit_msgs.msg import Grasp, MotionPlanRequest, MoveGroupGoal, PickupGoal, PlaceGoal

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
        connection = connect(ns)
        description = load(robot_description, ns)
        model = description.model
        if name not in model.groups:
            raise RuntimeError("Group '%s' was not found; the robot has %s"
                               % (name, ", ".join(model.groups) or "no groups"))
        connection.advertise("trajectory_execution_event")
        connection.wait_for_actions(["move_group", "execute_trajectory"], wait_for_servers)
        own = description.kinematics.get(name) or {}
        usual = RequestSettings
        settings = RequestSettings(
            joint_tolerance=float(own.get("goal_joint_tolerance", usual.joint_tolerance)),
            position_tolerance=float(own.get("goal_position_tolerance", usual.position_tolerance)),
            orientation_tolerance=float(own.get("goal_orientation_tolerance", usual.orientation_tolerance)),
            velocity_scaling=description.velocity_scaling, acceleration_scaling=description.acceleration_scaling)
        super().__init__(connection, model, model.groups[name], settings)
        # MoveIt's commander is made of this object, and programs use it.
        self._g = WrappedGroup(self)

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

    def plan(self, joints: JointsLike | PoseLike | None = None) -> PlanTuple:
        """Plan, as :meth:`go` does; return (success, RobotTrajectory, planning time, MoveItErrorCodes).

        The tuple can be used as the trajectory itself, too (:class:`PlanTuple`).
        """
        result = self._ended("move_group", self._goal(joints, plan_only=True))
        return PlanTuple((result.error_code.val == MoveItErrorCodes.SUCCESS, result.planned_trajectory,
                          result.planning_time, result.error_code))

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
