# SPDX-License-Identifier: BSD-3-Clause
"""Base of digital and analogue channels: find a channel, and set it until it reports the value."""
from __future__ import annotations

import errno
import re
from typing import Any

import rospy

from baxter_dataflow import wait_for

from . import startup

# What channels of the navigators, then called ITB, were named in SDK 1.0.
OLD_NAME = re.compile("((?:torso_)?(?:left|right))_itb_(button[012]|light_inner|light_outer|wheel)")
NEW_PARTS = {"button0": "button_ok", "button1": "button_back", "button2": "button_show", "light_inner": "inner_light",
             "light_outer": "outer_light", "wheel": "wheel"}


def present_name(name: str) -> str:
    """Return the name that a channel has since SDK 1.1."""
    old = OLD_NAME.fullmatch(name)
    return "%s_%s" % (old[1], NEW_PARTS[old[2]]) if old else name


class IOChannel:
    """A channel of the robot by its name.

    A subclass defines its name (`KIND` in the topics' names, `ADJECTIVE` in errors), its messages, and how to read a
    value from a state; it may override `_on_change`. A name of SDK 1.0, such as "left_itb_button0", is replaced by the
    present one, with a warning. Raises OSError with errno ETIMEDOUT if the channel does not
    report, rospy.ROSInitException before rospy.init_node.
    """

    KIND: str
    ADJECTIVE: str
    STATE: type
    COMMAND: type

    def __init__(self, component_id: str) -> None:
        self._id = present_name(component_id)
        if self._id != component_id:
            rospy.logwarn("the %s channel %r of SDK 1.0 is now called %r", self.ADJECTIVE, component_id, self._id)
        self._last: Any = None
        self._publisher: rospy.Publisher  # of an output
        topic = "/robot/%s_io/%s/state" % (self.KIND, self._id)
        self._subscriber = rospy.Subscriber(topic, self.STATE, self._on_state, queue_size=10)
        try:
            startup.wait_for_part(topic, lambda: self._last is not None)
        except BaseException:
            self._subscriber.unregister()
            raise
        self._is_output = not self._last.isInputOnly
        if self._is_output:
            self._publisher = rospy.Publisher("/robot/%s_io/command" % self.KIND, self.COMMAND, queue_size=10)
            startup.wait_for_subscribers(self._publisher)

    @staticmethod
    def _value(message: Any):
        """The value in a message of state."""
        raise NotImplementedError

    def _on_change(self, value: float) -> None:
        """Called when the reported value differs from the last one."""

    def _require_output(self) -> None:
        """Raise OSError with errno EACCES if the channel is an input."""
        if not self._is_output:
            raise OSError(errno.EACCES, "the %s channel %s is an input: it cannot be set" % (self.ADJECTIVE, self._id))

    def _set(self, value: float, timeout: float) -> None:
        """Set the channel and wait until it reports `value`; with `timeout` 0 [s, ROS time] do not wait.

        Raises OSError with errno ETIMEDOUT if it did not follow.
        """
        command = self.COMMAND(name=self._id, value=value)
        self._publisher.publish(command)
        if timeout != 0:
            wait_for(lambda: self._value(self._last) == value, timeout, rate=100,
                     body=lambda: self._publisher.publish(command),
                     timeout_msg="the %s channel %s was set to %s, but did not report that within %.1f s"
                                 % (self.ADJECTIVE, self._id, value, timeout))

    def _on_state(self, message: Any) -> None:
        before, self._last = self._last, message
        if before is not None and self._value(before) != self._value(message):
            self._on_change(self._value(message))
