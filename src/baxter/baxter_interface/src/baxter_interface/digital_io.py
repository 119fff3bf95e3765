# SPDX-License-Identifier: BSD-3-Clause
"""One digital channel of the robot: a button, a light, a cuff."""
from __future__ import annotations

from typing import Any

from baxter_core_msgs.msg import DigitalIOState, DigitalOutputCommand

from baxter_dataflow import Signal

from .io_channel import IOChannel


class DigitalIO(IOChannel):
    """A digital channel by its name, such as "left_lower_cuff" or "torso_left_inner_light".

    Attributes:
        state_changed: Signal, called with the new state (bool) when it differs from the last one.
    Waits up to 30 s of wall time for a robot that is still starting, and 5 s for the channel of one that is up.
    Raises OSError with errno ETIMEDOUT if the channel does not report, rospy.ROSInitException before rospy.init_node.
    """

    KIND, ADJECTIVE, STATE, COMMAND = "digital", "digital", DigitalIOState, DigitalOutputCommand

    def __init__(self, component_id: str) -> None:
        self.state_changed = Signal()
        super().__init__(component_id)

    @property
    def is_output(self) -> bool:
        """Whether the channel can be set."""
        return self._is_output

    @property
    def state(self) -> bool:
        """The channel's last reported state (bool). Assigning to it is set_output with the default time-out."""
        return self._value(self._last)

    @state.setter
    def state(self, value: float) -> None:
        self.set_output(value)

    def set_output(self, value: float, timeout: float = 2.0) -> None:
        """Set the channel and wait until it reports `value` (bool); with `timeout` 0 [s, ROS time] do not wait.

        Raises OSError: errno EACCES if the channel is an input, ETIMEDOUT if it did not follow.
        """
        self._require_output()
        self._set(bool(value), timeout)

    @staticmethod
    def _value(message: Any) -> bool:
        return message.state == DigitalIOState.PRESSED

    def _on_change(self, value: float) -> None:
        self.state_changed(value)
