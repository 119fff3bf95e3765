# SPDX-License-Identifier: BSD-3-Clause
"""One analogue channel of the robot: a range sensor, a wheel, the fan."""
from __future__ import annotations

from typing import Any

from baxter_core_msgs.msg import AnalogIOState, AnalogOutputCommand

from .io_channel import IOChannel
from .joint_checks import require_count


class AnalogIO(IOChannel):
    """An analogue channel by its name, such as "left_hand_range" [mm] or "torso_fan" [%].

    Waits up to 30 s of wall time for a robot that is still starting, and 5 s for the channel of one that is up.
    Raises OSError with errno ETIMEDOUT if the channel does not report, rospy.ROSInitException before rospy.init_node.
    """

    KIND, ADJECTIVE, STATE, COMMAND = "analog", "analogue", AnalogIOState, AnalogOutputCommand

    def state(self) -> float:
        """Return the channel's last reported value (float), in the unit of the channel."""
        return self._value(self._last)

    def is_output(self) -> bool:
        """Tell whether the channel can be set."""
        return self._is_output

    def set_output(self, value: float, timeout: float = 2.0) -> None:
        """Set the channel to a whole number, 0 to 65535, and wait until it reports that number.

        With `timeout` 0 [s, ROS time] it does not wait.
        Raises OSError: errno EACCES if the channel is an input, ETIMEDOUT if it did not follow; ValueError for a number
        that is out of range or not whole.
        """
        self._require_output()
        self._set(require_count(value, 65535, "the value of %s" % self._id), timeout)

    @staticmethod
    def _value(message: Any):
        return message.value
