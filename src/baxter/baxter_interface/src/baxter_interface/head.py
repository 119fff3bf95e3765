# SPDX-License-Identifier: BSD-3-Clause
"""The head: it turns, and it nods."""
from __future__ import annotations

import errno
import math
from typing import Any, cast

import rospy
from baxter_core_msgs.msg import HeadPanCommand, HeadState
from std_msgs.msg import Bool

from baxter_dataflow import wait_for

from . import startup
from .hindrance import wait_for_motion
from .joint_checks import require_number
from .settings import HEAD_PAN_ANGLE_TOLERANCE

# The head turns so far to each side [rad].
_RANGE_RAD = 0.5 * math.pi


class Head:
    """The robot's head. Angles are in rad, positive to the robot's left.

    Waits up to 30 s of wall time for a robot that is still starting, and 5 s for the head of one that is up.
    Raises OSError with errno ETIMEDOUT if it does not report, rospy.ROSInitException before rospy.init_node.
    """

    def __init__(self) -> None:
        self._last = cast("HeadState", None)  # until the first one has come, for which the constructor waits
        self._pan_publisher = rospy.Publisher("/robot/head/command_head_pan", HeadPanCommand, queue_size=10)
        self._nod_publisher = rospy.Publisher("/robot/head/command_head_nod", Bool, queue_size=10)
        topic = "/robot/head/head_state"
        self._subscriber = rospy.Subscriber(topic, HeadState, self._on_state, queue_size=1)
        try:
            startup.wait_for_part(topic, lambda: self._last is not None)
        except BaseException:
            for end in (self._subscriber, self._pan_publisher, self._nod_publisher):
                end.unregister()
            raise
        startup.wait_for_subscribers(self._pan_publisher)
        startup.wait_for_subscribers(self._nod_publisher)

    def pan(self) -> float:
        """Return the head's angle [rad]."""
        return self._last.pan

    def nodding(self) -> bool:
        """Tell whether the head is nodding."""
        return self._last.isNodding

    def panning(self) -> bool:
        """Tell whether the head is turning."""
        return self._last.isTurning

    def set_pan(self, angle: float, speed: float = 1.0, timeout: float = 10.0, scale_speed: bool = False) -> None:
        """Turn the head and wait until it is within HEAD_PAN_ANGLE_TOLERANCE of `angle` [rad], -pi/2 to pi/2.

        Parameters:
            speed: share of full speed, 0.0 to 1.0; with `scale_speed` in percent. A value out of range is logged and
            sent. timeout: longest time for it [s, ROS time]; 0 sends the command once and does not wait.
        Raises OSError with errno ETIMEDOUT, at once with ERANGE for an angle out of the head's range, to whose end it
        turns; ValueError for a number that is not finite.
        """
        angle = require_number(angle, "the head's angle [rad]")
        ratio = require_number(speed, "the head's speed") / (100.0 if scale_speed else 1.0)
        if not HeadPanCommand.MIN_SPEED_RATIO <= ratio <= HeadPanCommand.MAX_SPEED_RATIO:
            rospy.logerr("head: the speed is %r, it should be from 0 to %d", speed, 100 if scale_speed else 1)
        command = HeadPanCommand(target=angle, speed_ratio=ratio,
                                 enable_pan_request=HeadPanCommand.REQUEST_PAN_ENABLE)
        self._pan_publisher.publish(command)
        if timeout == 0:
            return
        if abs(angle) > _RANGE_RAD + HEAD_PAN_ANGLE_TOLERANCE:
            raise OSError(errno.ERANGE, "the head turns from %.3f to %.3f rad, not to %.3f rad" % (
                -_RANGE_RAD, _RANGE_RAD, angle))
        wait_for_motion(lambda: abs(self.pan() - angle) <= HEAD_PAN_ANGLE_TOLERANCE, timeout,
                        lambda: self._pan_publisher.publish(command), "the head did not turn to %.3f rad" % angle)

    def command_nod(self, timeout: float = 5.0) -> None:
        """Nod once and wait for its end; `timeout` [s, ROS time] applies to its start, and again to its end.

        With `timeout` 0 the command is sent once and not waited for. Raises OSError with errno ETIMEDOUT.
        """
        self._nod_publisher.publish(True)
        if timeout != 0:
            wait_for_motion(self.nodding, timeout, lambda: self._nod_publisher.publish(True),
                            "the head did not begin to nod")
            wait_for(lambda: not self.nodding(), timeout, rate=100, body=lambda: self._nod_publisher.publish(False),
                     timeout_msg="the head did not end its nod within %.1f s" % timeout)

    def _on_state(self, message: Any) -> None:
        self._last = message
