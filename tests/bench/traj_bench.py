#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Send an arm to the pre-pose of the lab notes: command jitter, tracking error, a picture of commanded and measured.

    ./baxter.sh sim roslaunch baxter_gazebo baxter_world.launch gui:=false enable:=true
    ./baxter.sh sim rosrun baxter_traj_streamer traj_interpolator_as
    ./baxter.sh sim tests/bench/traj_bench.py --png traj.png        each in a separate terminal
"""
import argparse
import os
import sys
import threading
import time

import numpy as np
import rospy
from baxter_core_msgs.msg import JointCommand
from sensor_msgs.msg import JointState

from baxter_model import poses
from baxter_traj_streamer.moves import PoseMove
from baxter_traj_streamer.settings import SIDES, arm_joint_names
from baxter_traj_streamer.traj_client import TrajClient
from lab_testing.waiting import wait_until

# Where the move begins [rad]: neutral, the same signs for both arms.
NEUTRAL = list(poses().angles("neutral", "left").values())
# Time after the last command until the arm counts as at rest, and time that it is then watched [s, simulated].
SETTLED_S, REST_S = 0.5, 1.0
PICTURE_SIZE = (1000, 900)


class Recorder:
    """Commands as (simulated, wall, seven angles), joint states as (stamp, seven angles)."""

    def __init__(self, side):
        self._names = arm_joint_names(side)
        self._lock = threading.Lock()
        self.commands, self.states = [], []
        self._subscribers = [
            rospy.Subscriber("/robot/limb/%s/joint_command" % side, JointCommand, self._on_command, tcp_nodelay=True),
            rospy.Subscriber("/robot/joint_states", JointState, self._on_states, tcp_nodelay=True)]

    def wait_until_still(self, seconds):
        """Wait until joint states reach this long [s, simulated] after the last command, or after the first joint
        state."""
        def have_come():
            since = self.commands[-1][0] if self.commands else self.states[0][0] if self.states else None
            return since is not None and bool(self.states) and self.states[-1][0] >= since + seconds

        wait_until(have_come, "joint states of an arm that rests for %g s" % seconds, 60.0)

    def _on_command(self, message):
        if message.mode == JointCommand.RAW_POSITION_MODE:
            now, wall = rospy.get_time(), time.monotonic()
            angles = dict(zip(message.names, message.command, strict=True))
            self.commands.append((now, wall, [angles[name] for name in self._names]))

    def _on_states(self, message):
        angles = dict(zip(message.name, message.position, strict=True))
        if all(name in angles for name in self._names):
            self.states.append((message.header.stamp.to_sec(), [angles[name] for name in self._names]))


def draw(path, names, commands, states, errors):
    """Commanded and measured angles above, their differences below, over simulated time."""
    os.environ["QT_QPA_PLATFORM"] = "offscreen"  # before Qt is loaded
    import pyqtgraph
    from pyqtgraph.Qt import QtWidgets

    from live_plot.graph import COLOURS

    pyqtgraph.mkQApp()
    pyqtgraph.setConfigOptions(antialias=True, background="w", foreground="k")
    window = QtWidgets.QWidget()
    layout = QtWidgets.QVBoxLayout(window)
    angles, differences = pyqtgraph.PlotWidget(), pyqtgraph.PlotWidget()
    angles.setTitle("pre-pose by the notes' rule: commanded (thin), measured (broad, pale)")
    angles.setLabel("left", "angle [rad]")
    differences.setLabel("left", "measured - commanded [mrad]")
    differences.setLabel("bottom", "simulated time [s]")
    for plot in (angles, differences):
        plot.showGrid(x=True, y=True, alpha=0.3)
        layout.addWidget(plot)
    angles.addLegend(offset=(10, -10))
    begin = commands[0][0]
    commanded_at, stamps = ([row[0] - begin for row in rows] for rows in (commands, states))
    for joint, name in enumerate(names):
        colour = pyqtgraph.mkColor((*COLOURS, "#56b4e9")[joint])
        pale = pyqtgraph.mkColor(colour)
        pale.setAlpha(90)
        angles.plot(stamps, [row[-1][joint] for row in states], pen=pyqtgraph.mkPen(pale, width=6))
        angles.plot(commanded_at, [row[-1][joint] for row in commands], name=name,
                    pen=pyqtgraph.mkPen(colour, width=1.5))
        differences.plot(stamps, 1e3 * errors[:, joint], pen=pyqtgraph.mkPen(colour, width=1.5))
    window.resize(*PICTURE_SIZE)
    window.show()
    QtWidgets.QApplication.processEvents()
    if not window.grab().save(path):
        sys.exit("%s cannot be written" % path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("side", nargs="?", choices=SIDES, default="right")
    parser.add_argument("--png", help="file for the picture (default: none)")
    options = parser.parse_args()
    rospy.init_node("traj_bench", anonymous=True)
    client = TrajClient()
    client.wait_until_ready()
    move = PoseMove(client)
    client.move(move.trajectory(options.side, NEUTRAL, time_optimal=True))
    Recorder(options.side).wait_until_still(REST_S)
    recorder = Recorder(options.side)
    client.move(move.trajectory(options.side, "pre_pose"))
    recorder.wait_until_still(SETTLED_S + REST_S)

    commands, states = list(recorder.commands), list(recorder.states)
    simulated, wall = np.array([row[0] for row in commands]), np.array([row[1] for row in commands])
    commanded = np.array([row[-1] for row in commands])
    states = [row for row in states if row[0] >= simulated[0]]
    stamps, measured = np.array([row[0] for row in states]), np.array([row[-1] for row in states])
    errors = measured - np.array([np.interp(stamps, simulated, column) for column in commanded.T]).T
    moving, resting = stamps <= simulated[-1], stamps >= simulated[-1] + SETTLED_S
    print("%d commands in %.2f s (%.2f s of wall time)" % (
        len(commands), simulated[-1] - simulated[0], wall[-1] - wall[0]))
    for clock, times in (("simulated", simulated), ("wall", wall)):
        gaps = 1e3 * np.diff(times)
        print("period, %-9s  mean %6.3f ms  standard deviation %6.3f ms  longest %7.3f ms" % (
            clock, gaps.mean(), gaps.std(), gaps.max()))
    for what, where in (("moving", moving), ("at rest", resting)):
        print("tracking error, %-7s  greatest %.5f rad over %d joint states" % (
            what, np.abs(errors[where]).max(), where.sum()))
    if options.png:
        draw(options.png, arm_joint_names(options.side), commands, states, errors)
        print(options.png)


if __name__ == "__main__":
    main()
