# SPDX-License-Identifier: BSD-3-Clause
"""The robot on the graph for a test's web clients, and where they find the server."""
import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from lab_testing.waiting import wait_until

NAMES, POSITIONS = ["a", "b"], [1.5, -2.0]
_PERIOD_S = 0.05


def address_of(node):
    """The address of a web server that was started with ~port 0, as soon as it listens."""
    name = "/%s/actual_port" % node
    wait_until(lambda: rospy.has_param(name), "the port of %s" % node)
    return "ws://127.0.0.1:%d/" % rospy.get_param(name)


class WebRobot:
    """Publishes joint states on ``/lab/state``, and on ``/lab/echo`` each text that comes on ``/lab/heard``; ``heard``:
    these texts.
    """

    def __init__(self):
        self._state = rospy.Publisher("/lab/state", JointState, queue_size=1)
        self._echo = rospy.Publisher("/lab/echo", String, latch=True, queue_size=1)
        self.heard = []
        self._kept = [rospy.Subscriber("/lab/heard", String, self._hear),
                      rospy.Timer(rospy.Duration(_PERIOD_S), self._tick)]

    def _tick(self, _event):
        message = JointState(name=NAMES, position=POSITIONS)
        message.header.stamp = rospy.Time.now()
        self._state.publish(message)

    def _hear(self, message):
        self.heard.append(message.data)
        self._echo.publish(message)
