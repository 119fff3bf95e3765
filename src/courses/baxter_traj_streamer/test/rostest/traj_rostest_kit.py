# SPDX-License-Identifier: BSD-3-Clause
"""Shared code of the rostests of trajActionServer."""
import functools
import random
import time
import unittest

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from baxter_core_msgs.msg import JointCommand
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from baxter_traj_streamer.ros_settings import read_limits
from baxter_traj_streamer.settings import SIDES
from baxter_traj_streamer.streamer import BaxterTrajStreamer
from baxter_traj_streamer.traj_client import SentGoal
from baxter_traj_streamer.versions import NOTES, version
from lab_testing import waiting

DEADLINE_S = 90.0


wait_until = functools.partial(waiting.wait_until, timeout_s=DEADLINE_S)
# The name in the launch files of the rostests.
SERVER = "/traj_interpolator_as"


class Client:
    """One goal, with all its feedback and states."""

    def __init__(self, action=NOTES):
        self._version = version(action)
        self._action = actionlib.ActionClient("trajActionServer", self._version.action)
        assert self._action.wait_for_server(rospy.Duration(DEADLINE_S)), "no trajActionServer"
        self.feedback = []
        self.goal = None

    def send(self, names, points, traj_id=0):
        trajectory = JointTrajectory(joint_names=names)
        trajectory.points = [JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration.from_sec(time_s))
                             for time_s, positions in points]
        self.feedback.clear()
        self.goal = SentGoal(self._action, self._version.make_goal(trajectory, traj_id), self.feedback.append)

    def wait_until_moving(self):
        wait_until(lambda: any(percent >= 20 for percent in self.feedback), "the goal to be a fifth done")

    def end(self):
        """State, text, result."""
        assert self.goal.wait(DEADLINE_S), "the goal did not end"
        return self.goal.outcome()


class FakeRobotTest(unittest.TestCase):
    """Against the SDK's fake robot, enabled."""

    # The server's version of the action.
    action = NOTES
    # The joint that forget_commands moves.
    last_joints = ("right_w2", "left_w2")

    @classmethod
    def setUpClass(cls):
        cls.streamer = BaxterTrajStreamer()
        cls.limits = read_limits()
        cls.enable = rospy.Publisher("/robot/set_super_enable", Bool, queue_size=1)
        cls.asker = Client(cls.action)
        cls.commands = []
        cls.subscribers = [rospy.Subscriber("/robot/limb/%s/joint_command" % side, JointCommand, cls.on_command)
                           for side in SIDES]
        wait_until(lambda: all(any(connection.callerid_pub == SERVER for connection in subscriber.impl.connections)
                               for subscriber in cls.subscribers), "the commands of %s" % SERVER)

    @classmethod
    def on_command(cls, message):
        cls.commands.append((time.monotonic(), message))

    def setUp(self):
        wait_until(lambda: self.enable.get_num_connections() > 0, "the robot to listen")
        self.set_enabled(True)
        self.client = Client(self.action)
        self.forget_commands()

    def forget_commands(self):
        """Clear the list of commands, after all commands sent so far have arrived.

        Results overtake commands, which have connections of their own; so a goal is sent whose last command is known.
        """
        names = self.last_joints
        goal = self.angles(names) + 1e-4 * random.random()
        self.client.send(names, [(0.05, goal)])
        state, text, _ = self.client.end()
        self.assertEqual(state, GoalStatus.SUCCEEDED, text)
        wanted = dict(zip(names, goal.tolist(), strict=True))

        def arrived(name):
            return any(message.mode == JointCommand.POSITION_MODE and name in message.names
                       and message.command[message.names.index(name)] == wanted[name]
                       for _, message in list(self.commands))

        wait_until(lambda: all(map(arrived, names)), "the last commands")
        self.commands.clear()
        self.client.feedback.clear()

    def set_enabled(self, enabled):
        """Returns when this program and the server know of it."""
        self.enable.publish(Bool(data=enabled))
        wait_until(lambda: (self.streamer.robot.why_not_ready() == "") == enabled, "enabled to be %s" % enabled)
        wait_until(lambda: self.server_would_move() == enabled, "the server to know that enabled is %s" % enabled)

    def server_would_move(self):
        """Query the robot's state in the server by a goal that is always refused."""
        self.asker.send([], [])
        state, text, _ = self.asker.end()
        self.assertEqual(state, GoalStatus.REJECTED, text)
        return "no points" in text

    def angles(self, names):
        found = self.streamer.robot.angles()
        return np.array([found[name] for name in names])

    def wait_until_at(self, names, goal, within=0.01):
        """This program's joint states may be older than the server's."""
        wait_until(lambda: np.abs(self.angles(names) - goal).max() < within,
                   lambda: "%s at %s; they are at %s" % (names, goal, self.angles(names)))

    def wait_until_held(self, joint):
        """Results overtake commands: wait until the joint's last command is in POSITION mode; returns its value."""
        def holding():
            last = [message for _, message in list(self.commands) if joint in message.names][-1:]
            return last if last and last[0].mode == JointCommand.POSITION_MODE else None

        message, = wait_until(holding, "%s to be held" % joint)
        return message.command[message.names.index(joint)]

    def raw_stream(self, joint):
        return [(stamp, message.command[message.names.index(joint)]) for stamp, message in list(self.commands)
                if message.mode == JointCommand.RAW_POSITION_MODE and joint in message.names]

    def inwards(self, names, by):
        """Angles at this distance from the joints, towards the middle of their ranges, where there is room."""
        middle = [0.5 * (self.limits[name].lower + self.limits[name].upper) for name in names]
        here = self.angles(names)
        return here + np.where(here < middle, by, np.negative(by))

    def move(self, names, by, duration_s, **options):
        goal = self.inwards(names, by)
        self.client.send(names, [(0.0, self.angles(names)), (duration_s, goal)], **options)
        return goal
