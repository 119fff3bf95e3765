# SPDX-License-Identifier: BSD-3-Clause
"""Reasons why the robot does not do what a program asks, read from the robot's own topics.

These come 100 times a second each. Listening all the time would cost each program more than its own work, so they are
read only while something does not move.
"""
from __future__ import annotations

import errno
import threading
from collections.abc import Callable
from typing import Any

import rospy
from baxter_core_msgs.msg import AssemblyState, CollisionAvoidanceState, CollisionDetectionState, DigitalIOState

from baxter_dataflow import wait_for
from baxter_dataflow.waiting import is_unlimited
from baxter_model.readiness import held_by_avoidance, why_not_ready

from . import startup
from .joint_motion import DISABLED_GRACE_S, MAKING_ROOM_S, NO_HINDRANCE, STILL_S, Hindrance, Standstill

# Longest wait for one state of a robot [s, wall]; one that is present sends 100 a second.
STATE_TIMEOUT_S = 1.0
COLLIDES = "it feels a collision: something is in its way"
SQUEEZED = "its cuff is squeezed: let go of it"
_CUFF = "robot/digital_io/%s_lower_cuff/state"
# The robot is asked why nothing happens after so long [s, ROS time].
ASK_AFTER_S = 1.0


def robot_refusal() -> str:
    """Ask the robot why it takes no commands; "" if it does, or does not answer."""
    try:
        return why_not_ready(rospy.wait_for_message("robot/state", AssemblyState, STATE_TIMEOUT_S))
    except rospy.ROSException:
        return ""


def ask_what_holds(side: str, is_kept_away: bool) -> str:
    """Ask the robot once what holds back the arm "left" or "right"; "" for nothing that it tells.

    `is_kept_away`: whether its commands were of a mode in which collision avoidance acts.
    """
    prefix = "robot/limb/%s/" % side
    avoidance = newest(prefix + "collision_avoidance_state", CollisionAvoidanceState) if is_kept_away else None
    if avoidance is not None and avoidance.collision_object:
        return held_by_avoidance(avoidance.collision_object)
    cuff = newest(_CUFF % side, DigitalIOState)
    if cuff is not None and cuff.state == DigitalIOState.PRESSED:
        return SQUEEZED
    detection = newest(prefix + "collision_detection_state", CollisionDetectionState)
    return COLLIDES if detection is not None and detection.collision_state else ""


def newest(topic: str, kind: type) -> Any:
    """The next message of a topic, or its latched one; None where nobody publishes it."""
    if not startup.topic_published(rospy.resolve_name(topic)).is_met():
        return None
    try:
        return rospy.wait_for_message(topic, kind, STATE_TIMEOUT_S)
    except rospy.ROSException:
        return None


def wait_for_motion(test: Callable[[], bool], timeout: float, body: Callable[[], object], text: str) -> None:
    """As wait_for, with `body` 100 times a second; ends early where the robot takes no commands.

    `timeout` [s, ROS time]. Raises OSError with errno ETIMEDOUT and `text`, with the robot's reason if it has one.
    """
    first_s = ASK_AFTER_S if is_unlimited(timeout) else min(timeout, ASK_AFTER_S)
    if wait_for(test, first_s, raise_on_error=False, rate=100, body=body):
        return
    if why := robot_refusal():
        raise OSError(errno.ETIMEDOUT, "%s: %s" % (text, why))
    rest_s = timeout if is_unlimited(timeout) else timeout - first_s
    wait_for(test, rest_s, rate=100, body=body, timeout_msg="%s within %.1f s" % (text, timeout))


class IgnoredCommands:
    """Notices commands to a robot that takes none. Times are of any clock that does not go back [s]."""

    def __init__(self) -> None:
        self._refusal = ""
        self._sent_s = None

    def sent(self, now_s: float) -> None:
        """A command was sent."""
        if self._refusal and self._sent_s is None:
            self._sent_s = now_s

    def heard(self, now_s: float, refusal: str) -> str:
        """The robot has reported `refusal`, why it takes no commands, "" if it does.

        Returns it if it held before the last command and holds still: news of enabling may come after the command.
        """
        self._refusal = refusal
        if not refusal:
            self._sent_s = None
        elif self._sent_s is not None and now_s - self._sent_s >= DISABLED_GRACE_S:
            self._sent_s = None
            return refusal
        return ""


class ArmHindrance:
    """Reasons why one arm, "left" or "right", does not move. Its methods may be called by any thread."""

    def __init__(self, side: str) -> None:
        self._side = side
        self._lock = threading.Lock()
        self._standstill = Standstill()
        self._subscribers = []
        self._forget()

    def _forget(self) -> None:
        self._near, self._by_other_arm = [], False
        self._collides = self._cuff = False

    def begin(self) -> None:
        """A new motion begins, perhaps another way: the arm has not stood still in it."""
        with self._lock:
            self._standstill = Standstill()

    def look(self, now_s: float, is_far: bool, angles: dict[str, float]) -> Hindrance:
        """Return what keeps the arm from moving, NO_HINDRANCE as long as it does not stand still.

        `now_s` [s, ROS time], `is_far` and `angles` as of Standstill.look. Listens to the robot while the arm stands
        still.
        """
        with self._lock:
            still_s = self._standstill.look(now_s, is_far, angles)
            if still_s < STILL_S:
                self._close()
                return NO_HINDRANCE
            self._open()
            if self._near:
                return Hindrance(held_by_avoidance(self._near), not self._by_other_arm or still_s >= MAKING_ROOM_S)
            if self._cuff:
                return Hindrance(SQUEEZED)
            return Hindrance(COLLIDES if self._collides else "")

    def close(self) -> None:
        """Listen no longer."""
        with self._lock:
            self._close()

    def _open(self) -> None:
        if self._subscribers:
            return
        prefix = "robot/limb/%s/" % self._side
        self._subscribers = [
            rospy.Subscriber(prefix + "collision_avoidance_state", CollisionAvoidanceState, self._on_avoidance,
                             queue_size=1),
            rospy.Subscriber(prefix + "collision_detection_state", CollisionDetectionState, self._on_detection,
                             queue_size=1),
            rospy.Subscriber(_CUFF % self._side, DigitalIOState, self._on_cuff,
                             queue_size=1)]

    def _close(self) -> None:
        while self._subscribers:
            self._subscribers.pop().unregister()
        self._forget()

    def _on_avoidance(self, message: Any) -> None:
        self._near, self._by_other_arm = list(message.collision_object), message.other_arm

    def _on_detection(self, message: Any) -> None:
        # One is enough: the arm stops for a while, and takes commands again.
        self._collides = self._collides or message.collision_state

    def _on_cuff(self, message: Any) -> None:
        self._cuff = message.state == DigitalIOState.PRESSED
