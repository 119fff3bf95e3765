# SPDX-License-Identifier: BSD-3-Clause
"""The action server that moves an arm along trajectories: robot/limb/<limb>/follow_joint_trajectory."""
from __future__ import annotations

import collections
import threading
import traceback
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from actionlib.action_server import ActionServer
from baxter_core_msgs.msg import JointCommand
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryResult,
)
from std_msgs.msg import UInt16
from trajectory_msgs.msg import JointTrajectoryPoint

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import LoopStopwatch, Ticker
from baxter_interface import Limb
from baxter_interface.goal_loop import SHORTEST_GOAL_S, start
from baxter_interface.hindrance import ask_what_holds
from baxter_interface.joint_limits import read_joint_limits
from command_line.options import counted
from joint_trajectory import (
    ErrorCode,
    GoalOutcome,
    Limits,
    NoPoints,
    TrajectoryError,
    code_of_error,
    code_of_outcome,
    command_of,
    joint_indices,
    tolerances_of,
)

from .arm_motion import LIMIT_SLACK_RAD, ArmMotion, CommandMode, GoalDefaults
from .robot_watch import RobotWatch

if TYPE_CHECKING:
    from baxter_interface.dynamic_parameters import ParameterServer

# Period of an idle server's checks that the robot is still there [s, wall].
_IDLE_S = 0.5
# Time to process each point of a goal [s]; a long goal starts this much later, and so without a jump.
_POINT_S = 1e-5
# Longest wait for the loop to end [s, wall].
_END_TIMEOUT_S = 2.0


class JointTrajectoryActionServer:
    """Moves one arm along trajectories, at `rate` commands a second.

    Parameters:
        limb: "left" or "right".
        reconfig_server: object with a mapping `config` of the parameters, such as a dynamic_reconfigure server; read at
            each goal.
        rate: commands per second [Hz].
        mode: "position_w_id" (raw positions, with velocities and accelerations beside them), "position", "velocity".
    Each goal ends once: succeeded, aborted with an error_code and an error_string, or preempted. An invalid one is
    aborted before anything moves, and does not disturb others. While the process gets no processor, the
    trajectory waits; no part of it is skipped. After a goal its end is held, until the next one, or until the robot is
    disabled, the cuff is squeezed, another node commands the arm, or clean_shutdown(). Waits up to 30 s of wall time
    for the robot, and raises, as Limb does.
    """

    def __init__(self, limb: str, reconfig_server: ParameterServer, rate: float = 100.0,
                 mode: str = "position_w_id") -> None:
        self._mode = CommandMode(mode)
        self._config = reconfig_server
        self._limb = Limb(limb)
        self._names = self._limb.joint_names()
        self._watch = RobotWatch(limb)
        self._motion = ArmMotion(self._names, self._mode, 1.0 / rate, self._read_limits())
        self._requests = collections.deque()
        self._wake = threading.Condition()
        self._ending = False
        # Requests arrive even while a simulation is paused.
        self._clock = RosClock(gives_up=lambda: (
            self._ending or self._requests or self._watch.was_interrupted() or self._watch.is_gone()))
        self._ticker = Ticker(self._clock, rate)
        # A command far ahead of the last one would take the arm off its path: each joint lags by its own time.
        self._stopwatch = LoopStopwatch(self._clock.now(), 1.0 / rate)
        self._was_gone = False

        prefix = "robot/limb/%s/" % limb
        # Latched: the rate is lost when the robot, or its simulation, is restarted.
        self._rate_publisher = rospy.Publisher("robot/joint_state_publish_rate", UInt16, queue_size=1, latch=True)
        self._rate_publisher.publish(round(rate))
        self._dynamics_publisher = rospy.Publisher(prefix + "inverse_dynamics_command", JointTrajectoryPoint,
                                                   queue_size=1, tcp_nodelay=True)
        self._command_subscriber = rospy.Subscriber(prefix + "joint_command", JointCommand, self._on_joint_command,
                                                    queue_size=1)
        self._server = ActionServer(prefix + "follow_joint_trajectory", FollowJointTrajectoryAction,
                                              self._on_goal, self._on_cancel, auto_start=False)
        self._thread = threading.Thread(target=self._guarded, name="%s arm" % limb, daemon=True)
        start(self._server)
        self._thread.start()

    def robot_is_enabled(self) -> bool:
        """Tell whether the robot is enabled."""
        return self._watch.is_enabled()

    def clean_shutdown(self) -> None:
        """End the goal, if there is one, and leave the arm holding where it is."""
        with self._wake:
            self._ending = True
            self._wake.notify()
        self._thread.join(_END_TIMEOUT_S)

    # -- rospy's threads --------------------------------------------------------------------------------------------

    def _on_goal(self, handle: Any) -> None:
        """Read a goal; refuse it at once if it is invalid in itself."""
        trajectory = handle.get_goal().trajectory
        try:
            if not trajectory.points:
                raise NoPoints()
            joint_indices(trajectory.joint_names, self._names, allow_partial=True)
            command = command_of(trajectory)
        except TrajectoryError as error:
            handle.set_accepted()
            self._refuse(handle, error)
        else:
            self._post(lambda: self._begin(handle, command))

    def _on_cancel(self, handle: Any) -> None:
        self._post(lambda: self._cancel(handle))

    def _on_joint_command(self, message: Any) -> None:
        if self._motion.engaged and message._connection_header["callerid"] != rospy.get_name():
            self._post(lambda: self._yield_to(message._connection_header["callerid"]))

    def _post(self, request) -> None:
        with self._wake:
            self._requests.append(request)
            self._wake.notify()

    # -- the loop's thread ------------------------------------------------------------------------------------------

    def _guarded(self) -> None:
        try:
            self._run()
        except Exception:
            # Publishing fails once ROS is down. Any other error is a fault, and a server without its loop is useless.
            if not rospy.is_shutdown():
                rospy.logfatal("%s arm: the trajectory server has failed:\n%s", self._limb.name, traceback.format_exc())
                rospy.signal_shutdown("the trajectory server of the %s arm has failed" % self._limb.name)

    def _run(self) -> None:
        while not self._ending:
            with self._wake:
                self._wake.wait_for(lambda: self._ending or self._requests or self._motion.engaged, _IDLE_S)
            self._tick()
            if self._motion.engaged:
                self._ticker.sleep()
        if self._motion.engaged:
            self._give_up("the trajectory server was shut down")
            # Position mode needs no stream of commands.
            self._limb.exit_control_mode()
        for request in self._drained():
            request()

    def _tick(self) -> None:
        self._tell_whether_gone()
        if self._motion.engaged and (trouble := self._watch.trouble()):
            self._give_up(trouble)
        for request in self._drained():
            request()
        if not self._motion.engaged:
            return
        now_s = self._now_s()
        goal = self._motion.goal
        position, velocity = self._measured()
        verdict = self._motion.tick(now_s, position, velocity)
        self._send(now_s)
        if goal is not None:
            self._publish_feedback(goal, now_s, position, velocity)
            if verdict is not None:
                self._conclude(goal, verdict)

    def _drained(self):
        while self._requests:
            yield self._requests.popleft()

    def _now_s(self):
        """The loop's own time [s], which never goes back, and hardly goes on while the loop is held up."""
        return self._stopwatch.elapsed_s(self._clock.now())

    def _measured(self):
        angles, velocities = self._limb.joint_angles(), self._limb.joint_velocities()
        return (np.array([angles[name] for name in self._names]),
                np.array([velocities.get(name, 0.0) for name in self._names]))

    def _begin(self, handle: Any, command):
        handle.set_accepted()
        why = "" if self._motion.engaged else self._watch.begin()
        if self._ending:
            why = "the trajectory server is being shut down"
        if why:
            return self._refuse(handle, why)
        goal = handle.get_goal()
        now_s, stamp = self._now_s(), goal.trajectory.header.stamp
        if stamp:
            command.start_time = now_s + stamp.to_sec() - self._clock.now()
        now_s += _POINT_S * len(command.times)
        before = self._motion.goal
        try:
            replacement = self._motion.begin(
                command, now_s, self._measured()[0], handle, GoalDefaults.from_config(self._config.config, self._names),
                tolerances_of(goal))
        except TrajectoryError as error:
            return self._refuse(handle, error)
        if before is not None:
            before.set_canceled(text="another goal took its place")
        if replacement.late_s > 0.0:
            rospy.logwarn("%s arm: %d of %s are left out: the first was due %.3f s ago", self._limb.name,
                          replacement.dropped, counted(len(command.times), "point"), replacement.late_s)

    def _cancel(self, handle: Any) -> None:
        if self._motion.goal is not None and self._motion.goal == handle:
            self._motion.stop(self._now_s(), self._measured()[0])
            handle.set_canceled(text="cancelled by request; the arm holds")

    def _yield_to(self, node) -> None:
        if self._motion.engaged and self._motion.goal is None:
            rospy.loginfo("%s arm: %s commands it now, so the end of the last trajectory is not held any longer",
                          self._limb.name, node)
            self._motion.release()

    def _send(self, now_s: float) -> None:
        command = self._motion.command()
        if self._mode is CommandMode.VELOCITY:
            self._limb.set_joint_velocities(command)
            return
        if self._mode is CommandMode.POSITION:
            self._limb.set_joint_positions(command)
            return
        self._limb.set_joint_positions(command, raw=True)
        if self._dynamics_publisher.get_num_connections():
            self._dynamics_publisher.publish(JointTrajectoryPoint(
                *self._motion.output.tolist(), [], rospy.Duration.from_sec(max(now_s - self._motion.begin_s, 0.0))))

    def _publish_feedback(self, goal, now_s: float, position: Any, velocity: np.ndarray) -> None:
        if self._server.feedback_pub is None or not self._server.feedback_pub.get_num_connections():
            return
        since = rospy.Duration.from_sec(max(now_s - self._motion.begin_s, 0.0))
        message = FollowJointTrajectoryFeedback(joint_names=self._names)
        message.header.stamp = rospy.get_rostime()
        message.desired = JointTrajectoryPoint(*self._motion.desired.tolist(), [], since)
        message.actual = JointTrajectoryPoint(position.tolist(), velocity.tolist(), [], [], since)
        message.error = JointTrajectoryPoint(*self._motion.error[:2].tolist(), [], [], since)
        goal.publish_feedback(message)

    # -- ends of goals ----------------------------------------------------------------------------------------------

    def _conclude(self, handle: Any, verdict) -> None:
        if verdict.outcome is GoalOutcome.SUCCEEDED:
            handle.set_succeeded(FollowJointTrajectoryResult(code_of_outcome(verdict.outcome), ""))
        else:
            # The loop has no time to wait for the robot's answer.
            threading.Thread(target=self._abort_with_reason, daemon=True,
                             args=(handle, code_of_outcome(verdict.outcome), verdict.text)).start()

    def _abort_with_reason(self, handle: Any, code, text: str) -> None:
        why = ask_what_holds(self._limb.name, is_kept_away=self._mode is not CommandMode.POSITION_WITH_DYNAMICS)
        self._abort(handle, code, "; ".join(filter(None, (text, why))))

    def _give_up(self, why) -> None:
        """End the goal or the hold, and stop the arm, if it can still be commanded.

        The last command may be far from the arm's present position, and a robot follows it until it expires.
        """
        goal = self._motion.goal
        if not self._watch.refusal():
            self._limb.halt()
        if goal is None:
            rospy.loginfo("%s arm: %s, so the end of the last trajectory is not held any longer", self._limb.name, why)
        else:
            text = "%s %.3f s after the start; %s is %.4f rad from its end" % (
                why, self._now_s() - self._motion.begin_s, *self._motion.farthest(self._measured()[0]))
            # The path was left; there is no more specific code.
            self._abort(goal, ErrorCode.PATH_TOLERANCE_VIOLATED.value, text)
        self._motion.release()

    def _refuse(self, handle: Any, error) -> None:
        """Abort a goal before its start; `error`: an exception or a text."""
        code = code_of_error(error, bool(handle.get_goal().trajectory.header.stamp))
        threading.Timer(SHORTEST_GOAL_S, self._abort, (handle, code, str(error))).start()

    def _abort(self, handle: Any, code, text: str) -> None:
        rospy.logerr("%s arm: goal aborted: %s", self._limb.name, text)
        handle.set_aborted(FollowJointTrajectoryResult(code, text), text)

    def _tell_whether_gone(self) -> None:
        gone = self._watch.is_gone()
        if gone and not self._was_gone:
            rospy.logwarn("%s arm: the robot is gone (nobody publishes joint states); goals are refused until it is "
                          "back", self._limb.name)
        elif self._was_gone and not gone:
            rospy.loginfo("%s arm: the robot is back", self._limb.name)
        self._was_gone = gone

    def _read_limits(self):
        limits = read_joint_limits(self._names).values()
        lower, upper, velocity = zip(*limits, strict=True)
        return Limits(self._names, lower, upper, velocity, LIMIT_SLACK_RAD)
