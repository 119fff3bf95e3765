#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Print one line of JSON with the messages of /clock, /robot/state and the simulator's /diagnostics within two seconds.
It is a separate process, because it needs ROS and the doctor must work without it."""

import json
import threading
from typing import Any

import rospy
from baxter_core_msgs.msg import AssemblyState
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock

LISTEN_S = 2.0
STATE_FIELDS = ("enabled", "stopped", "error")
SIMULATOR_STATUS = "gazebo: "  # prefix of the names of the simulator's statuses
THREADS_STATUS = ": threads"  # ending of the name of every node's status of its threads


def main() -> None:
    # Time from /clock may stand still, so use wall time.
    rospy.init_node("lab_doctor", anonymous=True, disable_signals=True, disable_rostime=True)
    clock, state, statuses = [], [], {}
    everything = threading.Event()

    def heard() -> None:
        simulator = any(name.startswith(SIMULATOR_STATUS) for name in statuses)
        if state and simulator and len(clock) > 1 and clock[-1] > clock[0]:
            everything.set()

    def on_clock(message: Any) -> None:
        clock.append(message.clock.to_sec())
        heard()

    def on_state(message: Any) -> None:
        state.append({name: bool(getattr(message, name)) for name in STATE_FIELDS})
        heard()

    def on_diagnostics(message: Any) -> None:
        statuses.update((status.name, (status.name, status.level, status.message)) for status in message.status
                        if status.name.startswith(SIMULATOR_STATUS) or status.name.endswith(THREADS_STATUS))
        heard()

    rospy.Subscriber("/clock", Clock, on_clock)
    rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics)
    rospy.Subscriber("/robot/state", AssemblyState, on_state)
    everything.wait(LISTEN_S)
    answer = {
        "clock_messages": len(clock),
        "clock_advanced": len(clock) > 1 and clock[-1] > clock[0],
        "robot_state": state[-1] if state else None,
        "troubles": [status for status in statuses.values() if status[1] > 0],
    }
    print(json.dumps(answer), flush=True)
    rospy.signal_shutdown("done")


if __name__ == "__main__":
    main()
