#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Print as one line of JSON what /clock, /robot/state and, of the simulator, /diagnostics say within two seconds. A
process of its own: it needs ROS, which the doctor must do without."""

import json
import threading

import rospy
from baxter_core_msgs.msg import AssemblyState
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock

LISTEN_S = 2.0
STATE_FIELDS = ("enabled", "stopped", "error")
SIMULATOR_STATUS = "gazebo: "  # what the names of the simulator's statuses begin with


def main():
    # Time from /clock could stand still; ours must not.
    rospy.init_node("lab_doctor", anonymous=True, disable_signals=True, disable_rostime=True)
    clock, state, statuses = [], [], []
    everything = threading.Event()

    def heard():
        if state and statuses and len(clock) > 1 and clock[-1] > clock[0]:
            everything.set()

    def on_clock(message):
        clock.append(message.clock.to_sec())
        heard()

    def on_state(message):
        state.append({name: bool(getattr(message, name)) for name in STATE_FIELDS})
        heard()

    def on_diagnostics(message):
        found = [status for status in message.status if status.name.startswith(SIMULATOR_STATUS)]
        if found:
            statuses[:] = [(status.name, status.level, status.message) for status in found]
            heard()

    rospy.Subscriber("/clock", Clock, on_clock)
    rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics)
    rospy.Subscriber("/robot/state", AssemblyState, on_state)
    everything.wait(LISTEN_S)
    answer = {
        "clock_messages": len(clock),
        "clock_advanced": len(clock) > 1 and clock[-1] > clock[0],
        "robot_state": state[-1] if state else None,
        "troubles": [status for status in statuses if status[1] > 0],
    }
    print(json.dumps(answer), flush=True)
    rospy.signal_shutdown("done")


if __name__ == "__main__":
    main()
