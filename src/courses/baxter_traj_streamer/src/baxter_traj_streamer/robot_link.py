# SPDX-License-Identifier: BSD-3-Clause
"""The robot's joint angles and state, for the streamer."""
from __future__ import annotations

import threading
import time
from typing import Any

import rospy
from baxter_core_msgs.msg import AssemblyState
from sensor_msgs.msg import JointState

from baxter_interface import startup
from baxter_interface.presence import Presence
from baxter_interface.resets import Resets
from baxter_model.readiness import STATES_KEPT, lost, why_not_ready


class RobotLink:
    """Joint angles and the robot's state, kept up to date.

    Joints are found by name in every message: robots omit some, and change their order.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._angles = {}
        self._state = None
        self._stops = 0
        self._heard_wall_s = time.monotonic()
        self._topic = rospy.resolve_name("robot/joint_states")
        self._presence = Presence(self._topic, lambda: time.monotonic() - self._heard_wall_s)
        self._resets = Resets()
        # Subscribe last: from here on callbacks run on another thread.
        self._subscribers = [
            rospy.Subscriber("robot/state", AssemblyState, self._on_state, queue_size=STATES_KEPT),
            rospy.Subscriber("robot/joint_states", JointState, self._on_joint_states, queue_size=1, tcp_nodelay=True)]

    def wait(self) -> None:
        """Wait for the robot as baxter_interface does. Raises OSError with errno ETIMEDOUT, which says what is
        missing."""
        startup.wait_for_start([
            startup.message_arrives(self._topic, lambda: bool(self.angles())),
            startup.message_arrives(rospy.resolve_name("robot/state"), lambda: self._state is not None)])

    def angles(self) -> dict[Any, Any]:
        """{joint: angle [rad]}, as last reported; a copy."""
        with self._lock:
            return dict(self._angles)

    @property
    def resets(self) -> int:
        """Number of resets of the simulated robot so far."""
        return self._resets.count

    @property
    def stops(self) -> int:
        """How often so far the robot ceased to take commands, for however short a time."""
        return self._stops

    def is_gone(self) -> bool:
        """Whether no node publishes joint angles any more. A paused simulation is not gone."""
        return self._presence.is_gone()

    def why_not_ready(self) -> str:
        """Why the arms will not move, as text; "" if they will."""
        state = self._state
        if state is None:
            return "the robot does not report its state (/robot/state); is it running?"
        if self.is_gone():
            return lost(self._topic)
        return why_not_ready(state)

    def _on_state(self, message: Any) -> None:
        if why_not_ready(message) and not (self._state is not None and why_not_ready(self._state)):
            self._stops += 1
        self._state = message

    def _on_joint_states(self, message: Any) -> None:
        with self._lock:
            self._angles.update(zip(message.name, message.position))  # noqa: B905 (a robot may send fewer)
            self._heard_wall_s = time.monotonic()
