# SPDX-License-Identifier: BSD-3-Clause
"""One analogue channel of the robot: a range sensor, a wheel, the fan."""
import errno

import rospy
from baxter_core_msgs.msg import AnalogIOState, AnalogOutputCommand

from baxter_dataflow import wait_for

from . import startup
from .joint_checks import require_count


class AnalogIO:
    """An analogue channel by its name, such as "left_hand_range" [mm] or "torso_fan" [%].

    Waits up to 30 s of wall time for a robot that is still starting, and 5 s for the channel of one that is up.
    Raises OSError with errno ETIMEDOUT if the channel does not report, rospy.ROSInitException before rospy.init_node.
    """

    def __init__(self, component_id):
        self._id = component_id
        self._last = None
        self._publisher = None
        topic = "/robot/analog_io/%s/state" % component_id
        self._subscriber = rospy.Subscriber(topic, AnalogIOState, self._on_state, queue_size=1)
        try:
            startup.wait_for_part(topic, lambda: self._last is not None)
        except BaseException:
            self._subscriber.unregister()
            raise
        self._is_output = not self._last.isInputOnly
        if self._is_output:
            self._publisher = rospy.Publisher("/robot/analog_io/command", AnalogOutputCommand, queue_size=10)
            startup.wait_for_subscribers(self._publisher)

    def state(self):
        """Return the channel's last reported value (float), in the unit of the channel."""
        return self._last.value

    def is_output(self):
        """Tell whether the channel can be set."""
        return self._is_output

    def set_output(self, value, timeout=2.0):
        """Set the channel to a whole number, 0 to 65535, and wait until it reports that number.

        With `timeout` 0 [s, ROS time] it does not wait.
        Raises OSError: errno EACCES if the channel is an input, ETIMEDOUT if it did not follow; ValueError for a number
        that is out of range or not whole.
        """
        if not self._is_output:
            raise OSError(errno.EACCES, "the analogue channel %s is an input: it cannot be set" % self._id)
        value = require_count(value, 65535, "the value of %s" % self._id)
        command = AnalogOutputCommand(name=self._id, value=value)
        self._publisher.publish(command)
        if timeout != 0:
            wait_for(lambda: self.state() == value, timeout, rate=100, body=lambda: self._publisher.publish(command),
                     timeout_msg="the analogue channel %s was set to %d, but did not report that within %.1f s"
                                 % (self._id, value, timeout))

    def _on_state(self, message):
        self._last = message
