#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A node with one of each: a service, a latched topic that is published in the caller's thread, a subscription."""
import threading

import rospy
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolResponse

from rospy_nodes.start import limit_ports

# More than a socket buffers for a client that does not read.
LARGE_BYTES = 20_000_000
HALF = "\udcff"


def fail(request):
    """End another thread by an error."""
    threading.Thread(target=lambda: 1 / 0, name="to be lost").start()
    raise rospy.ServiceException("as asked for")


def main():
    limit_ports()
    rospy.init_node("limited")
    latched = rospy.Publisher("latched", String, latch=True, queue_size=None)
    latched.publish(String("x" * LARGE_BYTES))
    echo = rospy.Publisher("echo", String, queue_size=10)
    keep = [rospy.Service("serve", SetBool, lambda request: SetBoolResponse(request.data, "served")),
            rospy.Service("fail", SetBool, fail),
            # Half a character cannot be sent.
            rospy.Service("half", SetBool, lambda request: SetBoolResponse(True, HALF if request.data else "whole")),
            rospy.Subscriber("heard", String, echo.publish), rospy.Subscriber("large", String, echo.publish)]
    rospy.spin()
    del keep


if __name__ == "__main__":
    main()
