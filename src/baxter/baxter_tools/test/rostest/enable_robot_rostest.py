#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""enable_robot.py as users call it: its output and its exit status."""
import functools
import os
import pathlib
import signal
import subprocess
import unittest

import rospy

from lab_testing import knobs
from lab_testing.waiting import stretched
from processes.ports import free_port

DEADLINE_S = stretched(60.0)
LAUNCH_FILE = pathlib.Path(__file__).with_name("enable_with_launch.launch")
RACES = 3


def enable_robot(*options, **environment):
    return subprocess.run(["rosrun", "baxter_tools", "enable_robot.py", *options], capture_output=True, text=True,
                          timeout=DEADLINE_S, env=dict(os.environ, **environment))


set_knobs = functools.partial(knobs.set_knobs, "/fake_robot")


class EnableRobotTest(unittest.TestCase):
    def setUp(self):
        set_knobs()

    def expect(self, options, status, *texts):
        result = enable_robot(*options)
        output = result.stdout + result.stderr
        self.assertEqual(result.returncode, status, output)
        for text in texts:
            self.assertIn(text, output)

    def test_no_options_print_the_usage(self):
        self.expect([], 0, "usage: enable_robot.py")

    def test_unknown_option_is_an_error(self):
        self.expect(["-x"], 2, "-x")

    def test_state_is_printed(self):
        self.expect(["-s"], 0, "enabled: False", "estop_button: 0")

    def test_options_are_carried_out_in_their_order(self):
        result = enable_robot("-s", "-e", "--state", "-d", "-s")
        self.assertEqual(result.returncode, 0, result.stderr)
        seen = [line for line in result.stdout.splitlines() if line.startswith("enabled")]
        self.assertEqual(seen, ["enabled: False", "enabled: True", "enabled: False"])

    def test_what_was_reached_is_said(self):
        self.expect(["-e"], 0, "the robot is enabled\n")
        self.expect(["-S", "-r", "-d"], 0, "the robot is stopped\n", "the robot is reset", "the robot is disabled\n")

    def test_stop_and_reset(self):
        self.expect(["-e", "-S", "-s"], 0, "stopped: True")
        self.expect(["--reset", "-s"], 0, "stopped: False", "enabled: False")

    def test_refusal_is_status_1_with_the_reason_and_ends_the_list(self):
        set_knobs(refuse_enable=True)
        result = enable_robot("-e", "-s")
        self.assertEqual(result.returncode, 1)
        self.assertIn("enable_robot.py: failed to enable the robot", result.stderr)
        self.assertNotIn("estop_button: 0\n", result.stdout)
        self.assertNotIn("Traceback", result.stderr)

    def test_stop_button_is_named(self):
        set_knobs(stop_button=True)
        self.expect(["-e"], 1, "its stop button is pressed")

    def test_version_mismatch_is_status_1_with_the_fix(self):
        self.addCleanup(rospy.set_param, "/rethink/software_version", "1.2.0.57")
        rospy.set_param("/rethink/software_version", "2.1.2")
        self.expect(["-s"], 1, "2.1.2", "rosparam set /rethink/software_version")

    def test_started_at_the_same_moment_as_roslaunch(self):
        for turn in range(RACES):
            port = str(free_port())
            uri = "http://localhost:" + port
            launch = subprocess.Popen(["roslaunch", "-p", port, str(LAUNCH_FILE)], stdout=subprocess.DEVNULL,
                                      stderr=subprocess.DEVNULL, env=dict(os.environ, ROS_MASTER_URI=uri))
            try:
                result = enable_robot("-e", "-s", ROS_MASTER_URI=uri)
            finally:
                launch.send_signal(signal.SIGINT)
                launch.wait(DEADLINE_S)
            self.assertEqual(result.returncode, 0, "turn %d: %s" % (turn, result.stderr))
            self.assertIn("enabled: True", result.stdout)


if __name__ == "__main__":
    import rostest
    rospy.init_node("enable_robot_rostest")
    rostest.rosrun("baxter_tools", "enable_robot", "__main__")
