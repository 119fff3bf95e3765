# SPDX-License-Identifier: BSD-3-Clause
"""One digital channel of the robot: a button, a light, a cuff."""
import errno

import rospy
from baxter_core_msgs.msg import DigitalIOState, DigitalOutputCommand

from baxter_dataflow import Signal, wait_for

from . import startup


class DigitalIO:
    """A digital channel by its name, such as "left_lower_cuff" or "torso_left_inner_light".

    Attributes:
        state_changed: Signal, called with the new state (bool) when it differs from the last one.
    Waits up to 30 s of wall time for a robot that is still starting, and 5 s for the channel of one that is up.
    Raises OSError with errno ETIMEDOUT if the channel does not report, rospy.ROSInitException before rospy.init_node.
    """

    def __init__(self, component_id):
        self._id = component_id
        self._last = None
        self.state_changed = Signal()
        self._publisher = None
        topic = "/robot/digital_io/%s/state" % component_id
        self._subscriber = rospy.Subscriber(topic, DigitalIOState, self._on_state, queue_size=10)
        try:
            startup.wait_for_part(topic, lambda: self._last is not None)
        except BaseException:
            self._subscriber.unregister()
            raise
        self._is_output = not self._last.isInputOnly
        if self._is_output:
            self._publisher = rospy.Publisher("/robot/digital_io/command", DigitalOutputCommand, queue_size=10)
            startup.wait_for_subscribers(self._publisher)

    @property
    def is_output(self):
        """Whether the channel can be set."""
        return self._is_output

    @property
    def state(self):
        """The channel's last reported state (bool). Assigning to it is set_output with the default time-out."""
        return self._is_on(self._last)

    @state.setter
    def state(self, value):
        self.set_output(value)

    def set_output(self, value, timeout=2.0):
        """Set the channel and wait until it reports `value` (bool); with `timeout` 0 [s, ROS time] do not wait.

        Raises OSError: errno EACCES if the channel is an input, ETIMEDOUT if it did not follow.
        """
        if not self._is_output:
            raise OSError(errno.EACCES, "the digital channel %s is an input: it cannot be set" % self._id)
        value = bool(value)
        command = DigitalOutputCommand(name=self._id, value=value)
        self._publisher.publish(command)
        if timeout != 0:
            wait_for(lambda: self.state == value, timeout, rate=100, body=lambda: self._publisher.publish(command),
                     timeout_msg="the digital channel %s was set to %s, but still reports %s after %.1f s"
                                 % (self._id, value, not value, timeout))

    @staticmethod
    def _is_on(message):
        return message.state == DigitalIOState.PRESSED

    def _on_state(self, message):
        before, self._last = self._last, message
        if before is not None and self._is_on(before) != self._is_on(message):
            self.state_changed(self._is_on(message))
