# SPDX-License-Identifier: BSD-3-Clause
"""Moves joints along trajectories: the action, topics and service of joint_trajectory_controller.

The package ``joint_trajectory`` has the core; this module connects it with messages and joints.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rospy
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryResult,
    JointTrajectoryControllerState,
)
from control_msgs.srv import QueryTrajectoryState, QueryTrajectoryStateResponse
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from command_line.options import counted
from controller_manager import EFFORT, POS_VEL, POS_VEL_ACC, POSITION, VELOCITY, Controller, ControllerError, Gains, Pid
from controller_manager.pid_tuning import TunablePids
from joint_trajectory import (
    Follower,
    GoalOutcome,
    GoalVerdict,
    Tolerances,
    TrajectoryError,
    bounds,
    code_of_error,
    code_of_outcome,
    command_of,
    joint_indices,
    merge_tolerances,
    tolerances_of,
)
from loop_ros.action_server import ActionServer, GoalHandle
from sim_time.pace import Pace
from sim_time.stamps import stamp

if TYPE_CHECKING:
    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware


class JointTrajectoryController(Controller):
    """Follows trajectories of the joints in parameter ``joints``; base of the classes at the end of this file.

    Further parameters, with their defaults:

    ``constraints/goal_time`` 0.0 s
        allowed delay at a goal
    ``constraints/stopped_velocity_tolerance`` 0.01 rad/s or m/s
        the velocity below which a joint has stopped, at a goal
    ``constraints/<joint>/trajectory``, ``constraints/<joint>/goal`` 0 rad or m
        position error allowed on the way and at a goal; 0: any
    ``state_publish_rate`` 50 Hz, ``action_monitor_rate`` 20 Hz
        rates of ``state`` and of the action's feedback; 0: never
    ``stop_trajectory_duration`` 0.0 s
        how long a stop may take; 0: stand at once where the joints are
    ``allow_partial_joints_goal`` false
        whether a trajectory may leave joints out

    Inside, times are the seconds for which the controller has run; they never run backwards.
    """

    interface: str

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        self._joints = context.texts("joints", "a list of joint names")
        self._index = self.claim(self.interface, self._joints)
        self._allow_partial = context.flag("allow_partial_joints_goal", False)
        self._follower: Follower[GoalHandle] = Follower(
            self._joints, self._continuous(), self._not_negative("stop_trajectory_duration", 0.0), self._allow_partial)
        self._tolerances = self._default_tolerances()
        self._state_pace = Pace(self._not_negative("state_publish_rate", 50.0))
        self._feedback_pace = Pace(self._not_negative("action_monitor_rate", 20.0))
        self._runs = False
        self._time_s = 0.0  # control time of the last update
        self._uptime = 0.0
        self._dt = 0.0
        self._began = 0.0  # uptime at which the last command was accepted
        self._position = np.zeros(len(self._joints))
        self._velocity = np.zeros(len(self._joints))
        self._next = np.zeros((3, len(self._joints)))
        self._make_adapter()
        self._server = ActionServer(context, "follow_joint_trajectory", FollowJointTrajectoryAction, self._on_goal,
                                    self._on_cancel)
        self._commands = context.subscription("command", JointTrajectory)
        self._state = context.publisher("state", JointTrajectoryControllerState)
        context.service("query_state", QueryTrajectoryState, self._query_state)

    # -- parameters -----------------------------------------------------------------------------------------------

    def _continuous(self):
        robot = self.context.robot
        if robot is None:
            raise ControllerError("%s needs the robot's URDF to know its joints: parameter %s is missing; load the "
                                  "robot's description" % (self.context.namespace,
                                                           self.context.in_root("robot_description")))
        absent = [joint for joint in self._joints if joint not in robot.joints]
        if absent:
            raise ControllerError("parameter %s: the URDF has no joint %s; it has %s" % (
                self.context.resolve("joints"), ", ".join(absent),
                ", ".join(joint.name for joint in robot.movable_joints())))
        return np.array([robot.joints[joint].type == "continuous" for joint in self._joints], dtype=bool)

    def _default_tolerances(self):
        count = len(self._joints)
        path, goal = (np.array([self._not_negative("constraints/%s/%s" % (joint, kind), 0.0) for joint in self._joints])
                      for kind in ("trajectory", "goal"))
        stopped = self._not_negative("constraints/stopped_velocity_tolerance", 0.01)
        return Tolerances(bounds(count, position=path), bounds(count, position=goal, velocity=stopped),
                          self._not_negative("constraints/goal_time", 0.0))

    def _not_negative(self, name, default):
        value = self.context.number(name, default)
        if value < 0.0:
            raise ControllerError("parameter %s is %g, expected 0 or more" % (self.context.resolve(name), value))
        return value

    # -- life -------------------------------------------------------------------------------------------------------

    def starting(self, time_s: float) -> None:
        self._commands.take()  # drop commands from before the start
        self._time_s, self._uptime, self._began = time_s, 0.0, 0.0
        self._measure()
        self._follower.start(0.0, self._position, self._velocity)
        self._state_pace.restart()
        self._start_adapter()
        self._runs = True

    def update(self, time_s: float, dt: float) -> None:
        self._time_s, self._dt = time_s, dt
        self._uptime += dt
        self._measure()
        follower, goal = self._follower, self._follower.goal
        verdict = follower.update(self._uptime, self._position, self._velocity)
        if verdict is not None and goal is not None:
            self._conclude(goal, verdict)
        self._server.spin(time_s)
        self._commands.handle(self._on_command)
        # A command acts until the next tick, so it is the desired state at that tick.
        self._next = follower.look_ahead(self._uptime + dt)
        self._write(dt)
        self._publish(time_s)

    def idle(self, time_s: float) -> None:
        self._server.spin(time_s)

    def stopping(self, time_s: float) -> None:
        self._runs = False
        if self._follower.goal is not None:
            goal = self._follower.goal
            self._follower.release()
            goal.cancel(text="the controller was stopped")

    def _measure(self):
        self._position = self.hardware.position[self._index]
        self._velocity = self.hardware.velocity[self._index]

    # -- commands ---------------------------------------------------------------------------------------------------

    @property
    def _next_cycle(self):
        """The first uptime [s] that a command can still change."""
        return self._uptime + self._dt

    def _on_goal(self, handle):
        if not self._runs:
            self._reject(handle, "%s does not run; start it with the controller manager" % self.context.namespace)
            return
        goal = handle.goal
        before = self._follower.goal
        try:
            tolerances = merge_tolerances(self._tolerances, self._joints, *tolerances_of(goal))
            # A joint without lag is still moving at the end: its velocity command became zero only in this cycle.
            tolerances = tolerances._replace(goal_time_s=tolerances.goal_time_s + self._dt)
            self._follow(goal.trajectory, handle, tolerances)
        except TrajectoryError as error:
            self._reject(handle, error)
        else:
            if before is not None:
                before.cancel(text="another goal took its place")
            handle.accept()
            self._feedback_pace.restart()

    def _reject(self, handle, error):
        """Reject a goal; ``error``: an exception or a text."""
        text = str(error)
        self.log.error("%s: goal rejected: %s" % (self.context.namespace, text))
        handle.reject(FollowJointTrajectoryResult(code_of_error(error), text), text)

    def _on_cancel(self, handle):
        if handle is self._follower.goal:
            self._follower.stop(self._next_cycle, self._position)
            self._began = self._next_cycle
        handle.cancel()

    def _on_command(self, message):
        before = self._follower.goal
        try:
            self._follow(message)
        except TrajectoryError as error:
            self.log.error_throttle(1.0, "%s: trajectory ignored: %s" % (self.context.resolve("command"), error))
            return
        if before is not None:
            before.cancel(text="a trajectory on %s took its place" % self.context.resolve("command"))

    def _follow(self, message, handle=None, tolerances=None):
        """Follow a ``trajectory_msgs/JointTrajectory``; raises :class:`TrajectoryError`."""
        now, start_time = self._next_cycle, None
        # On the topic, a message without points stops the joints, with any names.
        if message.points or handle is not None:
            joint_indices(message.joint_names, self._joints, self._allow_partial)
        if message.header.stamp:
            start_time = self._uptime + (message.header.stamp.to_sec() - self._time_s)
        command = command_of(message, start_time)
        replacement = self._follower.accept(command, now, self._position, handle, tolerances)
        self._began = now if start_time is None else start_time
        if replacement is not None and replacement.late_s > 0.0:
            self.log.warn("%s: %d of %s of a trajectory are left out: the first was due %.6f s ago"
                          % (self.context.namespace, replacement.dropped, counted(len(message.points), "point"),
                             replacement.late_s))

    def _conclude(self, handle: GoalHandle, verdict: GoalVerdict) -> None:
        self._follower.release()
        result = FollowJointTrajectoryResult(code_of_outcome(verdict.outcome), verdict.text)
        if verdict.outcome is GoalOutcome.SUCCEEDED:
            handle.succeed(result)
        else:
            self.log.error("%s: goal aborted: %s" % (self.context.namespace, verdict.text))
            handle.abort(result, verdict.text)

    # -- publications and queries ------------------------------------------------------------------------------------

    def _publish(self, time_s):
        if _take(self._state_pace, self._uptime) and self._state.has_listeners:
            self._state.publish(self._filled(JointTrajectoryControllerState(), time_s))
        goal = self._follower.goal
        if goal is not None and _take(self._feedback_pace, self._uptime) and self._server.feedback_is_heard:
            goal.publish_feedback(self._filled(FollowJointTrajectoryFeedback(), time_s))

    def _filled(self, message, time_s):
        since = rospy.Duration.from_sec(max(self._uptime - self._began, 0.0))
        desired, error = self._follower.desired, self._follower.error
        message.header.stamp = stamp(time_s)
        message.joint_names = self._joints
        message.desired = JointTrajectoryPoint(*desired.tolist(), [], since)
        message.actual = JointTrajectoryPoint(self._position.tolist(), self._velocity.tolist(), [], [], since)
        message.error = JointTrajectoryPoint(*error[:2].tolist(), [], [], since)
        return message

    def _query_state(self, request):
        if not self._runs:
            raise rospy.ServiceException("%s does not run" % self.context.namespace)
        try:
            state = self._follower.trajectory.query(self._uptime + (request.time.to_sec() - self._time_s))
        except TrajectoryError as error:
            raise rospy.ServiceException(str(error)) from error
        return QueryTrajectoryStateResponse(self._joints, *state.tolist())

    # -- for subclasses: use of the desired state -----------------------------------------------------------------

    def _make_adapter(self):
        """Read further parameters."""

    def _start_adapter(self):
        """Give the command for the tick in which the controller starts."""
        raise NotImplementedError

    def _write(self, dt):
        """Give the command for this tick: ``self._next`` is the desired state at its end."""
        raise NotImplementedError


class PositionJointTrajectoryController(JointTrajectoryController):
    """position_controllers/JointTrajectoryController: the desired positions are the commands."""

    interface = POSITION

    def _start_adapter(self):
        self.hardware.command[self.interface][self._index] = self._position

    def _write(self, dt):
        self.hardware.command[self.interface][self._index] = self._next[0]


class PosVelJointTrajectoryController(PositionJointTrajectoryController):
    """pos_vel_controllers/JointTrajectoryController: a joint that is at each tick's position has the velocity, too."""

    interface = POS_VEL


class PosVelAccJointTrajectoryController(PositionJointTrajectoryController):
    """pos_vel_acc_controllers/JointTrajectoryController, likewise."""

    interface = POS_VEL_ACC


class _PidTrajectoryController(JointTrajectoryController):
    """Command = ``velocity_ff/<joint>`` * desired velocity + PID(position error, velocity error), the PID of each joint
    in ``gains/<joint>``, which can be tuned at run time."""

    def _make_adapter(self):
        names = ["gains/%s" % joint for joint in self._joints]
        self._pid = Pid(Gains.from_params(self.context.entry, names))
        self._tuning = TunablePids.of_controller(self.context, self._pid, names)
        self._velocity_ff = np.array([self.context.number("velocity_ff/%s" % joint, 0.0) for joint in self._joints])

    def _start_adapter(self):
        self._pid.reset()
        self.hardware.command[self.interface][self._index] = 0.0

    def _write(self, dt):
        error = self._follower.error
        output = self._pid.update(error[0], dt, error[1])
        self._tuning.publish(self._time_s, dt, output)
        self.hardware.command[self.interface][self._index] = self._velocity_ff * self._next[1] + output


class VelocityJointTrajectoryController(_PidTrajectoryController):
    """velocity_controllers/JointTrajectoryController"""

    interface = VELOCITY


class EffortJointTrajectoryController(_PidTrajectoryController):
    """effort_controllers/JointTrajectoryController"""

    interface = EFFORT


def _take(pace, time_s):
    """Whether it is due; here, a rate of 0 Hz means never."""
    return pace.rate > 0.0 and pace.take(time_s)
