#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A simulator's /clock, and joint states that reach a subscriber half a second later, as on a busy machine.

Parameters: ~start_s, the first time on /clock; ~paused, whether time stays there.
"""
import threading

import rospy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from lab_testing.waiting import beats

STEP_S = 0.01
CONNECT_S = 0.5


class LateListeners(rospy.SubscribeListener):
    def __init__(self):
        self.heard = threading.Event()

    def peer_subscribe(self, topic_name, topic_publish, peer_publish):
        threading.Timer(CONNECT_S, self.heard.set).start()


def main():
    rospy.init_node("gazebo", disable_rostime=True)
    listeners = LateListeners()
    clock = rospy.Publisher("/clock", Clock, queue_size=1)
    states = rospy.Publisher("/robot/joint_states", JointState, listeners, queue_size=1)
    time_s, paused = rospy.get_param("~start_s"), rospy.get_param("~paused", False)
    for _ in beats(1.0 / STEP_S, rospy.is_shutdown):
        clock.publish(rospy.Time.from_sec(time_s))
        if listeners.heard.is_set():
            states.publish(JointState())
        time_s += 0.0 if paused else STEP_S


if __name__ == "__main__":
    main()
