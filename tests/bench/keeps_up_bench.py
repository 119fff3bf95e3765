# SPDX-License-Identifier: BSD-3-Clause
"""A whole lab at real time with both arms moving. Measures whether it keeps real time with its window, with rviz, with
a subscriber that has stopped reading, and with a busy thread inside /gazebo."""
import os
import signal
import statistics
import time

from labs import HERE, Lab, arrivals
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

SECONDS = 15.0
PLAN = [("/clock", Clock, 10), ("/robot/joint_states", JointState, 5)]
# The least real-time factor on an otherwise idle machine.
HEADLESS, DRAWN, DISTURBED = 0.99, 0.98, 0.95


def measure(report, quick, number):
    seconds = 2.0 if quick else SECONDS
    os.environ["PYTHONPATH"] = "%s:%s" % (HERE, os.environ.get("PYTHONPATH", ""))  # for the busy plugin
    with Lab(gui="false", enable="true", parameters={
            "/gazebo/model_plugins": {"libbench_busy.so": "busy_plugin:BusyPlugin"}}) as lab:
        lab.part("swing")
        add(report, lab, "headless", seconds, HEADLESS)
        stopped = lab.part("client")
        stopped.send_signal(signal.SIGSTOP)
        add(report, lab, "a stopped reader", seconds, DISTURBED)
        stopped.kill()
        lab.part("busy")
        add(report, lab, "a busy thread in /gazebo", seconds, DISTURBED)
    for what in ("gui", "rviz"):
        with Lab(screen=True, enable="true", **{"gui": "false", "rviz": "false", what: "true"}) as lab:
            lab.part("swing")
            add(report, lab, {"gui": "the window", "rviz": "rviz"}[what], seconds, DRAWN)
            if what == "gui":
                window, wall = lab.process("/gazebo_gui"), time.monotonic()
                used = window.cpu_s()
                arrivals(lab, PLAN, ("/robot/joint_states",), seconds)
                share = (window.cpu_s() - used) / (time.monotonic() - wall)
                report.add("the window: its own CPU", 100.0 * share, "% of a core")


def add(report, lab, what, seconds, least):
    """Note the real-time factor over ``seconds`` of wall time, with the subscribers of PLAN."""
    gazebo = lab.process("/gazebo")
    simulated, wall, used = lab.now(), time.monotonic(), gazebo.cpu_s()
    states, = arrivals(lab, PLAN, ("/robot/joint_states",), seconds)
    elapsed = time.monotonic() - wall
    gaps = [1e3 * (b - a) for a, b in zip(states, states[1:], strict=False)]
    report.add("%s: real-time factor" % what, (lab.now() - simulated) / elapsed, "x", least=least)
    report.add("%s: CPU of /gazebo" % what, 100.0 * (gazebo.cpu_s() - used) / elapsed, "% of a core")
    report.add("%s: joint_states, sd of the gaps" % what, statistics.stdev(gaps), "ms", samples=len(gaps))
