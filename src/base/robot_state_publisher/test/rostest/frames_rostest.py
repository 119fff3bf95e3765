#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Our node against Debian's, which gets the same joint states on the same master."""
import subprocess
import unittest
from pathlib import Path

import numpy as np
import rospy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from lab_testing.skipping import skip
from lab_testing.waiting import wait_until

ORIGINALS = [Path(folder, "robot_state_publisher/robot_state_publisher")
             for folder in ("/opt/ros/noetic/lib", "/usr/lib")]
MOVING = {"follows", "slides", "turns"}  # joints, in the order of both nodes
CHILD = {"turns": "b", "slides": "c", "follows": "d"}


def numbers(transform):
    """(7,) translation and quaternion."""
    t, q = transform.transform.translation, transform.transform.rotation
    return [t.x, t.y, t.z, q.x, q.y, q.z, q.w]


class Heard:
    """The messages of /tf and /tf_static of a node."""

    def __init__(self, node):
        self.tf, self.static = [], []
        self._subscribers = [rospy.Subscriber(node + "/tf", TFMessage, self.tf.append),
                             rospy.Subscriber(node + "/tf_static", TFMessage, self.static.append)]

    def is_connected(self):
        return self._subscribers[0].get_num_connections() == 1

    def states(self):
        """{stamp [ns]: message} of moving joints."""
        return {message.transforms[0].header.stamp.to_nsec(): message for message in list(self.tf)
                if message.transforms and message.transforms[0].child_frame_id[-1] in CHILD.values()}

    def fixed(self):
        return [message for message in self.static + self.tf if message.transforms[0].child_frame_id[-1] in "eg"]


class FramesTest(unittest.TestCase):
    def start_original(self, space):
        program = next((path for path in ORIGINALS if path.is_file()), None)
        if program is None:
            skip(self, "no robot_state_publisher of Debian's or ROS's is installed")
        tf = ["/%s:=%s/original/%s" % (topic, space, topic) for topic in ("tf", "tf_static")]
        process = subprocess.Popen([program, "__name:=original", "__ns:=" + space, *tf])
        self.addCleanup(process.wait)
        self.addCleanup(process.terminate)

    def compare(self, space, times_ms):
        """Send states at these times, two joints in one message and one in another; return what both nodes sent."""
        self.start_original(space)
        publisher = rospy.Publisher(space + "/joint_states", JointState, queue_size=100)
        heard = [Heard(space + "/" + node) for node in ("ours", "original")]
        wait_until(lambda: publisher.get_num_connections() == 2 and all(one.is_connected() for one in heard), "nodes")
        wait_until(lambda: all(one.fixed() for one in heard), "fixed frames")
        random = np.random.default_rng(5)
        for time_ms in times_ms:
            state = JointState(name=["turns", "stranger", "slides"], position=random.uniform(-3.0, 3.0, 3))
            if time_ms % 2:
                state = JointState(name=["slides"], position=random.uniform(-1.0, 1.0, 1))
            state.header.stamp = rospy.Time(100, time_ms * 1_000_000)
            publisher.publish(state)
            # The original keeps one message; it has to be read before the next one comes.
            wait_until(lambda stamp=state.header.stamp: self.is_through(heard, stamp), "states of %d ms" % time_ms)
        ours, original = (one.states() for one in heard)
        self.assertEqual(ours.keys(), original.keys())
        for stamp, message in ours.items():
            self.assert_same(message, original[stamp])
        self.assert_same(heard[0].fixed()[0], heard[1].fixed()[0])
        return heard

    def is_through(self, heard, stamp):
        return all(stamp.to_nsec() in one.states() for one in heard)

    def assert_same(self, ours, original):
        self.assertEqual([(one.header.frame_id, one.child_frame_id) for one in ours.transforms],
                         [(one.header.frame_id, one.child_frame_id) for one in original.transforms])
        np.testing.assert_allclose([numbers(one) for one in ours.transforms],
                                   [numbers(one) for one in original.transforms], rtol=0.0, atol=1e-12)

    def test_defaults(self):
        ours, original = self.compare("/plain", range(0, 900, 21))
        for one in (ours, original):
            self.assertEqual([len(message.transforms) for message in one.static], [2])
        children = [one.child_frame_id for one in next(iter(ours.states().values())).transforms]
        self.assertEqual(children, [CHILD[name] for name in sorted(MOVING)])

    def test_all_parameters(self):
        ours, original = self.compare("/all", range(0, 40, 2))
        for one in (ours, original):
            self.assertFalse(one.static)
            wait_until(lambda one=one: len(one.fixed()) > 3, "fixed frames on /tf")
            first, last = (message.transforms[0] for message in (one.fixed()[0], one.fixed()[-1]))
            self.assertEqual((first.header.frame_id[:5], first.child_frame_id[:5]), ("arms/", "arms/"))
            self.assertLess(first.header.stamp, last.header.stamp)


if __name__ == "__main__":
    import rostest

    rospy.init_node("frames_rostest")
    rostest.rosrun("robot_state_publisher", "frames", FramesTest)
