# SPDX-License-Identifier: BSD-3-Clause
"""The action server that turns the head: robot/head/head_action."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import rospy
from control_msgs.msg import SingleJointPositionAction, SingleJointPositionFeedback, SingleJointPositionResult

from baxter_interface import Head, RobotEnable
from baxter_interface.goal_loop import GoalLoop, GoalWork
from baxter_interface.joint_limits import read_joint_limits
from baxter_model import HEAD_JOINT

if TYPE_CHECKING:
    from baxter_interface.dynamic_parameters import ParameterServer

ACTION_NAME = "robot/head/head_action"


class HeadActionServer:
    """Turns the head to the goal's `position` [rad].

    `max_velocity` is the share of full speed, 0 to 1; 0 and less, or more than 1, mean full speed. `min_duration` is
    ignored. Parameters, from the mapping `reconfig_server.config` at each goal: `timeout` [s] (below 0: none) and
    `goal`, the error at which it is reached [rad]. A goal ends once: succeeded, aborted with a text that says why, or
    preempted; when it is not reached the head stops where it is. Waits for the robot, and raises, as Head does.
    """

    def __init__(self, reconfig_server: ParameterServer) -> None:
        self._config = reconfig_server
        self._head = Head()
        self._limit = read_joint_limits([HEAD_JOINT])[HEAD_JOINT]
        self._loop = GoalLoop(ACTION_NAME, SingleJointPositionAction, RobotEnable(), "head", self._begin)

    def clean_shutdown(self) -> None:
        """End the goal, if there is one."""
        self._loop.clean_shutdown()

    def _begin(self, handle: Any):
        goal = handle.get_goal()
        tolerance, timeout_s = self._config.config["goal"], self._config.config["timeout"]
        last = [rospy.get_time(), self._head.pan()]

        def step() -> bool:
            now_s, pan = rospy.get_time(), self._head.pan()
            velocity = (pan - last[1]) / (now_s - last[0]) if now_s > last[0] else 0.0
            last[:] = now_s, pan
            feedback = SingleJointPositionFeedback(position=pan, velocity=velocity, error=goal.position - pan)
            feedback.header.stamp = rospy.Time.from_sec(now_s)
            handle.publish_feedback(feedback)
            if abs(goal.position - pan) < tolerance:
                return True
            self._turn(goal.position, speed)
            return False

        speed = goal.max_velocity if 0.0 < goal.max_velocity <= 1.0 else 1.0
        return GoalWork(
            step, stop=lambda: self._turn(self._head.pan(), 1.0),
            missed=lambda: "the head is at %.4f rad, %.4f rad from its goal of %.4f rad (tolerance %g)" % (
                self._head.pan(), goal.position - self._head.pan(), goal.position, tolerance),
            make_result=SingleJointPositionResult, timeout_s=timeout_s, refusal=self._refusal(goal))

    def _refusal(self, goal) -> str:
        """Why a goal cannot be carried out, "" if it can."""
        if not math.isfinite(goal.position) or not math.isfinite(goal.max_velocity):
            return "position and max_velocity must be finite numbers, got %r and %r" % (
                goal.position, goal.max_velocity)
        slack = self._config.config["goal"]
        if not self._limit.lower - slack <= goal.position <= self._limit.upper + slack:
            return "the head turns from %.4f to %.4f rad, not to %.4f rad" % (
                self._limit.lower, self._limit.upper, goal.position)
        return ""

    def _turn(self, angle: float, speed: float) -> None:
        self._head.set_pan(angle, speed, timeout=0)
