#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Print as one line of JSON what /clock and /robot/state carry within two seconds. A process of its own: it needs ROS,
which the doctor must do without."""

import json
import threading

import rospy
from baxter_core_msgs.msg import AssemblyState
from rosgraph_msgs.msg import Clock

LISTEN_S = 2.0
STATE_FIELDS = ("enabled", "stopped", "error")


def main():
    # Time from /clock could stand still; ours must not.
    rospy.init_node("lab_doctor", anonymous=True, disable_signals=True, disable_rostime=True)
    clock, state = [], []
    both = threading.Event()

    def heard():
        if state and len(clock) > 1 and clock[-1] > clock[0]:
            both.set()

    def on_clock(message):
        clock.append(message.clock.to_sec())
        heard()

    def on_state(message):
        state.append({name: bool(getattr(message, name)) for name in STATE_FIELDS})
        heard()

    rospy.Subscriber("/clock", Clock, on_clock)
    rospy.Subscriber("/robot/state", AssemblyState, on_state)
    both.wait(LISTEN_S)
    answer = {
        "clock_messages": len(clock),
        "clock_advanced": len(clock) > 1 and clock[-1] > clock[0],
        "robot_state": state[-1] if state else None,
    }
    print(json.dumps(answer), flush=True)
    rospy.signal_shutdown("done")


if __name__ == "__main__":
    main()
