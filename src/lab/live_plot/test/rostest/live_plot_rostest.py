#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`rosrun live_plot plot` against a publisher: pictures without a display, errors, the end."""
import math
import os
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from lab_testing.waiting import wait_until

TOPIC = "/test_arm/joint_states"


class PlotTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.publisher = rospy.Publisher(TOPIC, JointState, queue_size=10)
        cls.text = rospy.Publisher("/test_text", String, queue_size=1, latch=True)
        cls.timer = rospy.Timer(rospy.Duration(0.02), cls.publish)

    @classmethod
    def tearDownClass(cls):
        cls.timer.shutdown()

    @classmethod
    def publish(cls, event):
        message = JointState(position=[math.sin(event.current_real.to_sec() + number) for number in range(3)])
        message.header.stamp = event.current_real
        cls.publisher.publish(message)

    def plot(self, *arguments, **environment):
        """Run it without a display; return (exit code, output, errors)."""
        environment = {**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": "", **environment}
        done = subprocess.run(["rosrun", "live_plot", "plot", *arguments], env=environment, timeout=60.0,
                              capture_output=True, text=True)
        return done.returncode, done.stdout, done.stderr

    def test_picture_without_a_display(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(os.environ.get("ROS_TEST_RESULTS_DIR", folder)) / "plot.png"
            code, output, errors = self.plot(TOPIC + "/position[0]:position[2]", "--png", str(file), "--seconds", "2")
            self.assertEqual(code, 0, errors)
            self.assertEqual(file.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        for label in ("position[0]", "position[2]"):
            (line,) = (line for line in output.splitlines() if line.startswith("%s/%s: " % (TOPIC, label)))
            samples, seconds = int(line.split()[1]), float(line.split()[4])
            self.assertGreater(samples, 10, line)
            self.assertGreater(seconds, 1.0)

    def test_mistakes_are_answered_with_the_right_names(self):
        for topic, parts in {
                TOPIC + "/posit[0]": ("has no field 'posit'", "position (float64[])"),
                TOPIC + "/position[3]": ("the array has 3 element(s)",),
                TOPIC + "/position": ("choose an element", "position[0]"),
                "/test_arm/joint_state/position[0]": ("no topic begins", TOPIC),
                "/test_text/data": ("(string) is not a number",)}.items():
            # It is waited for what nobody publishes, and not for long.
            patience = "1.5" if topic.startswith("/test_arm/joint_state/") else "50"
            code, _, errors = self.plot(topic, "--png", "/dev/null", "--seconds", "1", "--timeout", patience)
            self.assertEqual(code, 1, topic)
            for part in ("plot: ", *parts):
                self.assertIn(part, errors)
            self.assertNotIn("Traceback", errors)

    def test_window_needs_a_display_and_says_so(self):
        code, _, errors = self.plot(TOPIC + "/position[0]")
        self.assertEqual(code, 1)
        self.assertIn("--png", errors)

    def test_no_master_is_one_line(self):
        code, _, errors = self.plot(TOPIC + "/position[0]", ROS_MASTER_URI="http://localhost:1")
        self.assertEqual(code, 1)
        self.assertIn("plot: no ROS master at http://localhost:1", errors)

    def test_window_subscribes_and_ends_on_ctrl_c(self):
        environment = {**os.environ, "DISPLAY": ":0", "QT_QPA_PLATFORM": "offscreen"}
        # Waits for the first topic, plots the second.
        child = subprocess.Popen(["rosrun", "live_plot", "plot", "/test_nowhere/x", TOPIC + "/position[0]"],
                                 env=environment, start_new_session=True)
        try:
            wait_until(lambda: self.publisher.get_num_connections() or child.poll() is not None, "a subscription", 30.0)
            self.assertIsNone(child.poll(), "plot has ended")
            os.killpg(child.pid, signal.SIGINT)
            self.assertEqual(child.wait(60.0), 0)
        finally:
            if child.poll() is None:
                os.killpg(child.pid, signal.SIGKILL)


if __name__ == "__main__":
    import rostest
    rospy.init_node("live_plot_rostest")
    rostest.rosrun("live_plot", "live_plot", PlotTest)
