# SPDX-License-Identifier: BSD-3-Clause
"""The action server ``trajActionServer``: connects goals, their checks and the robot's joint commands."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from baxter_core_msgs.msg import JointCommand

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Ticker
from baxter_interface import goal_loop
from baxter_interface.goal_queue import GoalQueue
from baxter_interface.resets import PUT_ELSEWHERE
from joint_trajectory import rows_of_points

from .action_server import TrajServer
from .errors import GoalRefused
from .judging import judge
from .motion import StreamedMotion
from .settings import SIDES

if TYPE_CHECKING:
    from baxter_traj_streamer.settings import StreamerSettings
    from baxter_traj_streamer.versions import Version

    from .judging import AcceptedPlan, StreamedJointLimit
    from .robot_link import RobotLink

ACTION_NAME = "trajActionServer"
_FEEDBACK_PERIOD_S = 0.1
STOPPED_MEANWHILE = "the robot was disabled or stopped on the way; its arms have stopped where they were"


class Interpolator:
    """Streams one goal after the other; call :meth:`run` in the streaming thread.

    A refused goal does not affect the active one. An accepted one stops the active goal smoothly, and then starts.
    version: the clients' `versions.Version`.
    """

    def __init__(self, robot: RobotLink, limits: Mapping[str, StreamedJointLimit], settings: StreamerSettings,
                 version: Version) -> None:
        self._robot = robot
        self._limits = limits
        self._settings = settings
        self._version = version
        self._goals = GoalQueue(lambda handle, text: handle.set_canceled(self._result(handle), text))
        self._count = 0
        self._publishers = {side: rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1,
                                                  tcp_nodelay=True) for side in SIDES}
        self._server = TrajServer(ACTION_NAME, version, self._on_goal, self._goals.cancel)

    def run(self) -> None:
        """Serve until the node is shut down."""
        goal_loop.start(self._server)
        while not rospy.is_shutdown():
            # Woken by a goal; the time-out is for the shutdown.
            handle = self._goals.take(0.5)
            if handle is None:
                continue
            try:
                self._follow(handle)
            finally:
                self._goals.done()

    # -- rospy's threads ------------------------------------------------------------------------------------------

    def _on_goal(self, handle: Any) -> None:
        def check(is_busy: bool) -> None:
            # While an arm moves, the start of this goal is unknown; it is checked when the goal starts.
            self._judge(handle, None if is_busy else self._robot.angles())

        try:
            self._goals.put(handle, check)
        except GoalRefused as refusal:
            rospy.logwarn("goal refused: %s", refusal)
            handle.set_rejected(self._result(handle), str(refusal))

    # -- the loop -------------------------------------------------------------------------------------------------

    def _judge(self, handle: Any, measured: dict[str, float] | None) -> AcceptedPlan:
        why = self._robot.why_not_ready()
        if why:
            raise GoalRefused("robot", why)
        trajectory = handle.get_goal().trajectory
        return judge(trajectory.joint_names, rows_of_points(trajectory.points), self._limits, measured, self._settings)

    def _follow(self, handle: Any) -> None:
        before = self._robot.resets, self._robot.stops
        try:
            plan = self._judge(handle, self._robot.angles())
        except GoalRefused as refusal:
            rospy.logwarn("goal refused: %s", refusal)
            handle.set_rejected(self._result(handle), str(refusal))
            return
        self._count += 1
        handle.set_accepted()
        end, text = self._stream(handle, plan, *before)
        if text:
            rospy.logwarn("goal %d: %s", self._count, text)
        end(self._result(handle), text)

    def _stream(self, handle: Any, plan: AcceptedPlan, resets: int, stops: int):
        """Move the arms; returns how the goal ends: the handle's method, and a text.

        resets, stops: how many of each the robot had seen before ``plan`` was made.
        """
        now = rospy.get_time()
        motion = StreamedMotion(plan, now, self._settings.stop_deceleration)
        # After the end of a simulator, time stands still.
        ticker = Ticker(RosClock(gives_up=lambda: (
            rospy.is_shutdown() or self._robot.resets != resets or self._robot.is_gone())), self._settings.rate_hz)
        feedback_due = now
        settled_by = None
        while not rospy.is_shutdown():
            before, now = now, rospy.get_time()
            if why := self._robot.why_not_ready():
                return handle.set_aborted, why
            if why := self._why_elsewhere(now < before, resets, stops):
                # The last command is far from the arms' present position, and they follow it until it expires.
                self._command(plan.joint_names, np.zeros(len(plan.joint_names)), JointCommand.VELOCITY_MODE)
                return handle.set_aborted, why
            left_alone = self._settings.stop_when_client_leaves and not self._server.has_client(handle)
            if left_alone or self._is_unwanted():
                motion.stop(now)
            target = motion.positions(now)
            self._command(plan.joint_names, target, JointCommand.RAW_POSITION_MODE)
            if self._settings.feedback and now >= feedback_due:
                handle.publish_feedback(self._version.feedback(fdbk=motion.percent(now)))
                feedback_due = now + _FEEDBACK_PERIOD_S
            if motion.is_at_rest(now):
                settled_by = settled_by or now + self._settings.settle_time_s
                late = self._farthest(plan.joint_names, target)
                if late is None or now >= settled_by:
                    # Without further commands the robot would hold its position at that moment.
                    self._command(plan.joint_names, target, JointCommand.POSITION_MODE)
                    if motion.stopping:
                        stopped = "stopped at %d %% of the way" % motion.percent(now)
                        if left_alone:
                            return handle.set_aborted, stopped + ": the program that sent the goal is gone"
                        return handle.set_canceled, stopped
                    if late is None:
                        if self._settings.feedback:
                            handle.publish_feedback(self._version.feedback(fdbk=100))
                        return handle.set_succeeded, ""
                    return handle.set_aborted, late
            ticker.sleep()
        return handle.set_aborted, "the trajectory server was shut down"

    def _why_elsewhere(self, went_back: bool, resets: int, stops: int):
        """Why the arms are not where the plan has them, in words; empty while they are."""
        if went_back:
            return "time went backwards: the simulation was reset"
        if self._robot.resets != resets:
            return PUT_ELSEWHERE
        return STOPPED_MEANWHILE if self._robot.stops != stops else ""

    def _is_unwanted(self):
        """Whether the active goal was cancelled, or a newer one may replace it."""
        return self._settings.preemption and (self._goals.is_cancelled or self._goals.has_next)

    def _farthest(self, names: Sequence[str], target: Any) -> str | None:
        """A sentence about the joint that is farthest from its target; None if all are near."""
        angles = self._robot.angles()
        error = np.array([angles[name] for name in names]) - target
        joint = int(np.argmax(np.abs(error)))
        if abs(error[joint]) <= self._settings.goal_tolerance:
            return None
        return "%s is %.4f rad from its goal, %g are accepted (goal_tolerance) after %g s (settle_time_s)" % (
            names[joint], error[joint], self._settings.goal_tolerance, self._settings.settle_time_s)

    def _command(self, names: Sequence[str], values: Any, mode: int) -> None:
        for side, publisher in self._publishers.items():
            own = [i for i, name in enumerate(names) if name.startswith(side)]
            if own:
                publisher.publish(JointCommand(mode=mode, names=[names[i] for i in own],
                                               command=[values[i] for i in own]))

    def _result(self, handle: Any):
        """``return_val`` counts the executed goals, as the notes' server does."""
        return self._version.make_result(self._count, handle.get_goal())
