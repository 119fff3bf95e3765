#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A robot that leads, as far as its messages go: lines of JSON on standard input say its angles, cuff and presses."""
import json
import sys
import threading

import rospy
from baxter_core_msgs.msg import DigitalIOState, NavigatorState
from sensor_msgs.msg import JointState

from lab_testing.waiting import beats

SIDE, PRESS_S = "left", 0.2


def main():
    rospy.init_node("leading_robot")
    joints = rospy.Publisher("/robot/joint_states", JointState, queue_size=1)
    cuff, button = (rospy.Publisher("/robot/digital_io/%s_%s/state" % (SIDE, name), DigitalIOState, queue_size=1)
                    for name in ("lower_cuff", "lower_button"))
    navigator = rospy.Publisher("/robot/navigators/%s_navigator/state" % SIDE, NavigatorState, queue_size=1)
    newest, until = {"position": {}, "cuff": False}, {}

    def read():
        for line in sys.stdin:
            newest.update({"press": "", **json.loads(line)})
            if newest["press"]:
                until[newest["press"]] = rospy.get_time() + PRESS_S
        rospy.signal_shutdown("nobody leads")

    threading.Thread(target=read, daemon=True).start()
    for _ in beats(100.0, rospy.is_shutdown):
        now, angles = rospy.get_time(), newest["position"]
        joints.publish(JointState(name=list(angles), position=list(angles.values())))
        cuff.publish(DigitalIOState(state=int(newest["cuff"])))
        button.publish(DigitalIOState(state=int(until.get("lower_button", 0.0) > now)))
        navigator.publish(NavigatorState(buttons=[until.get("navigator", 0.0) > now, False, False]))


if __name__ == "__main__":
    main()
