#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A clock that begins at 100 s of simulated time."""
import rospy
from genpy import Time
from rosgraph_msgs.msg import Clock

from lab_testing.waiting import beats

BEGIN_S, STEP_S = 100.0, 0.02


def main():
    # ROS time would wait for this node's own clock.
    rospy.init_node("clock", disable_rostime=True)
    publisher = rospy.Publisher("/clock", Clock, queue_size=10)
    for number, _ in enumerate(beats(1.0 / STEP_S, rospy.is_shutdown)):
        publisher.publish(Time.from_sec(BEGIN_S + number * STEP_S))


if __name__ == "__main__":
    main()
