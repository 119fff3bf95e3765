# SPDX-License-Identifier: BSD-3-Clause
"""Watches robot, cuff and clock for reasons why an arm cannot be commanded, now or since a motion began."""
from __future__ import annotations

import math
import threading
import time
from typing import Any, cast

import rospy
from baxter_core_msgs.msg import AssemblyState, DigitalIOState
from sensor_msgs.msg import JointState

from baxter_interface import startup
from baxter_interface.presence import Presence
from baxter_interface.resets import PUT_ELSEWHERE, Resets
from baxter_model.readiness import STATES_KEPT, lost, why_not_ready

# Joint states come 50 times a second or more; older ones [s, ROS time] are not basis for motion.
STALE_AFTER_S = 0.5


class RobotWatch:
    """Watches the robot for one arm, "left" or "right".

    One message with a disabled robot is enough: events are kept until :meth:`begin`.
    """

    def __init__(self, side: str) -> None:
        self._side = side
        self._lock = threading.Lock()
        self._state = cast("AssemblyState", None)  # until the first one has come, for which the constructor waits
        self._cuff = False
        self._event = ""
        self._heard_ros_s = self._heard_wall_s = -math.inf
        self._topic = rospy.resolve_name("robot/joint_states")
        self._presence = Presence(self._topic, lambda: time.monotonic() - self._heard_wall_s)
        self._resets = Resets(self._on_reset)
        self._subscribers = [
            rospy.Subscriber("robot/state", AssemblyState, self._on_state, queue_size=STATES_KEPT),
            rospy.Subscriber("robot/joint_states", JointState, self._on_joint_states, queue_size=1, tcp_nodelay=True),
            # A robot without a cuff counts as one whose cuff is not squeezed.
            rospy.Subscriber("robot/digital_io/%s_lower_cuff/state" % side, DigitalIOState, self._on_cuff,
                             queue_size=1)]
        startup.wait_for_start([
            startup.message_arrives(str(self._subscribers[0].resolved_name), lambda: self._state is not None),
            startup.message_arrives(self._topic, lambda: self._heard_wall_s > -math.inf)])

    def begin(self) -> str:
        """Forget earlier events; return why the arm cannot be commanded, or ""."""
        with self._lock:
            self._event = ""
        return self.refusal()

    def refusal(self) -> str:
        """Why the arm cannot be commanded now, or ""."""
        with self._lock:
            state, cuff = self._state, self._cuff
        if self.is_gone() or self._age_s() > STALE_AFTER_S:
            return "the robot reports no joint states on %s" % self._topic
        return why_not_ready(state) or ("the %s cuff is squeezed" % self._side if cuff else "")

    def trouble(self) -> str:
        """The event since :meth:`begin` that ends a motion, or ""."""
        with self._lock:
            event = self._event
        if event:
            return event
        if self.is_gone():
            return lost(self._topic)
        age_s = self._age_s()
        if age_s > STALE_AFTER_S:
            return "the robot has reported no joint states for %.1f s" % age_s
        return ""

    def was_interrupted(self) -> bool:
        """Whether an event since :meth:`begin` ends a motion; cheaper than :meth:`trouble`."""
        return bool(self._event)

    def is_enabled(self) -> bool:
        """Whether the robot reports that it is enabled."""
        with self._lock:
            return self._state.enabled and not self._state.stopped

    def is_gone(self) -> bool:
        """Whether no node publishes joint states any more. A paused simulation is not gone."""
        return self._presence.is_gone()

    def _age_s(self):
        return rospy.get_time() - self._heard_ros_s

    def _note(self, event: Any) -> None:
        self._event = self._event or event

    def _on_state(self, message: Any) -> None:
        with self._lock:
            self._state = message
            if message.stopped:
                self._note("the robot was stopped")
            elif not message.enabled:
                self._note("the robot was disabled")

    def _on_reset(self) -> None:
        with self._lock:
            self._note(PUT_ELSEWHERE)

    def _on_cuff(self, message: Any) -> None:
        with self._lock:
            self._cuff = message.state == DigitalIOState.PRESSED
            if self._cuff:
                self._note("the %s cuff was squeezed" % self._side)

    def _on_joint_states(self, _message) -> None:
        now_s = rospy.get_time()
        with self._lock:
            if now_s < self._heard_ros_s:
                self._note("time went back from %.3f to %.3f s: the simulation was reset or restarted"
                           % (self._heard_ros_s, now_s))
            self._heard_ros_s, self._heard_wall_s = now_s, time.monotonic()

