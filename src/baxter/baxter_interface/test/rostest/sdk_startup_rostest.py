#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""RobotEnable and Limb in programs that start before the master, the clock, the parameters or the robot."""
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from own_master import DEADLINE_S, OwnMasterTest  # noqa: E402

# Simulated time of the fake robot: far from 0 and from the wall's.
CLOCK_START_S = 1000.0

PROGRAM = """
import sys, rospy
from baxter_interface import Limb, RobotEnable, startup
startup.LINE.again_after_s = 0.0
{before}
RobotEnable({versioned}).enable()
limb = Limb("left")
print("time", rospy.get_time(), "arrived", limb.move_to_joint_positions({{"left_w0": 0.2}}), flush=True)
"""
FIRST_ROBOT = "startup.init_node('client')"
FIRST_NODE = "rospy.init_node('client'); print('node is up', flush=True)"
IMPATIENT = "startup.STARTUP_TIMEOUT_S = 2.0; "


class StartupTest(OwnMasterTest):
    def start_client(self, before=FIRST_ROBOT, versioned=True, **environment):
        return self.start(sys.executable, "-c", PROGRAM.format(before=before, versioned=versioned), **environment)

    def expect_success(self, client):
        """Wait for the client's end; returns its ROS time [s]."""
        self.assertEqual(client.wait(DEADLINE_S), 0, client.output())
        result = re.search(r"time ([0-9.]+) arrived (\w+)", client.output())
        self.assertEqual(result.group(2), "True", client.output())
        return float(result.group(1))

    def expect_failure(self, client, *texts):
        self.assertEqual(client.wait(DEADLINE_S), 1, client.output())
        for text in texts:
            self.assertIn(text, client.output())

    def test_program_started_before_everything_uses_simulated_time(self):
        client = self.start_client()
        self.wait_for_text(client, "waiting for a ROS master at " + self.uri)
        self.start_master()
        self.wait_for_text(client, "waiting for /robot/state from " + self.uri)
        self.master.setParam("/use_sim_time", True)
        self.start_robot(clock_start_s=CLOCK_START_S)
        self.assertTrue(CLOCK_START_S < self.expect_success(client) < 2.0 * CLOCK_START_S)
        self.assertNotIn("it follows /clock", client.output())

    def test_node_older_than_use_sim_time_is_switched_to_it(self):
        self.start_master()
        client = self.start_client(FIRST_NODE)
        self.wait_for_text(client, "node is up")
        self.master.setParam("/use_sim_time", True)
        self.start_robot(clock_start_s=CLOCK_START_S)
        self.assertTrue(CLOCK_START_S < self.expect_success(client) < 2.0 * CLOCK_START_S)
        self.assertIn("from now on it follows /clock", client.output())

    def test_robot_in_wall_time_is_waited_for_too(self):
        self.start_master()
        client = self.start_client(FIRST_NODE)
        self.start_robot(start_delay_s=2.0)
        self.wait_for_text(client, "waiting for /robot/state from " + self.uri)
        self.assertGreater(self.expect_success(client), 1e9)

    def test_late_version_parameter_is_waited_for(self):
        self.start_master()
        self.start_robot(version="unset")
        client = self.start_client()
        self.wait_for_text(client, "waiting for the parameter /rethink/software_version")
        self.master.setParam("/rethink/software_version", "1.2.0")
        self.expect_success(client)

    def test_missing_version_parameter_ends_with_the_name(self):
        self.start_master()
        self.start_ready_robot(version="unset")
        self.expect_failure(self.start_client(IMPATIENT + FIRST_ROBOT),
                            "waited 2 s for the parameter /rethink/software_version", "it is not set")

    def test_version_mismatch_ends_an_unmodified_program_with_status_1(self):
        self.start_master()
        self.start_robot(version="2.1.2")
        self.expect_failure(self.start_client(), "VersionMismatch", "2.1.2")

    def test_no_master_ends_with_its_address(self):
        self.expect_failure(self.start_client(IMPATIENT + FIRST_ROBOT), "TimeoutError",
                            "waited 2 s for a ROS master at " + self.uri, "Connection refused", "ROS_MASTER_URI")

    def test_no_robot_ends_with_the_launch_command(self):
        self.start_master()
        for before in (FIRST_ROBOT, FIRST_NODE):
            self.expect_failure(self.start_client(IMPATIENT + before, versioned=False), "TimeoutError",
                                "nobody publishes it", "roslaunch baxter_gazebo baxter_world.launch")

    def test_wrong_namespace_is_recognised(self):
        self.start_master()
        self.start_ready_robot()
        client = self.start_client(IMPATIENT + FIRST_NODE, versioned=False, ROS_NAMESPACE="/elsewhere")
        self.expect_failure(client, "/elsewhere/robot/state", "wrong namespace")

    def test_dead_publisher_is_named(self):
        self.start_master()
        self.master.registerPublisher("/robot/state", "baxter_core_msgs/AssemblyState", "http://localhost:9")
        self.expect_failure(self.start_client(IMPATIENT + FIRST_ROBOT, versioned=False),
                            "/own_master_test publishes it, but no message of use came",
                            "rosnode ping /own_master_test")

    def test_missing_clock_is_named(self):
        self.start_master()
        self.master.setParam("/use_sim_time", True)
        self.start_ready_robot()
        self.expect_failure(self.start_client(IMPATIENT + FIRST_ROBOT),
                            "nobody publishes /clock", "rosparam set use_sim_time false")

    def test_program_that_is_no_node_is_told_so(self):
        self.start_master()
        self.expect_failure(self.start_client(""), "ROSInitException", "call rospy.init_node(name) first")

    def test_master_uri_that_is_none_is_told_so(self):
        self.expect_failure(self.start_client(ROS_MASTER_URI="localhost:11311"), "http://localhost:11311")


if __name__ == "__main__":
    import rostest
    rostest.rosrun("baxter_interface", "sdk_startup", "__main__")
