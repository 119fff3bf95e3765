#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""rospy.init_node returns when simulated time runs, in unmodified programs, with any Python."""
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import unittest

import rosgraph

from lab_testing.waiting import wait_until
from master_calls.simulator_start import SPAWNING
from processes.ports import free_port

DEADLINE_S = 60.0
HERE = pathlib.Path(__file__).resolve().parent
CLIENT = HERE / "vendor_client.py"
START_S = 1000.0
PYTHONS = (sys.executable, "/usr/bin/python3")

ONE_NODE = "import rospy; rospy.init_node('one'); print('node at', rospy.get_time(), flush=True)"
OWN_CLOCK = ("import rospy; from rosgraph_msgs.msg import Clock; rospy.Publisher('/clock', Clock, queue_size=1); "
             "rospy.init_node('bag'); print('node at', rospy.get_time(), flush=True)")
SPAWNER = ("import rospy, std_msgs.msg; rospy.Publisher('%s', std_msgs.msg.Empty, queue_size=1); "
           "rospy.init_node('urdf_spawner', disable_rostime=True); print('at work', flush=True); rospy.spin()"
           % SPAWNING)
TWICE = ONE_NODE + "; rospy.init_node('one'); print('again', flush=True)"


class FirstClockTest(unittest.TestCase):
    def setUp(self):
        self.uri = "http://localhost:%d" % free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_HOSTNAME="localhost", PYTHONUNBUFFERED="1")
        self.environment.pop("ROS_NAMESPACE", None)

    def start(self, *command):
        """Start a process that ends with the test; its output goes to a file."""
        output = tempfile.NamedTemporaryFile("w+")
        self.addCleanup(output.close)
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, env=self.environment)
        process.output = lambda: pathlib.Path(output.name).read_text()
        self.addCleanup(self.end, process)
        return process

    def end(self, process):
        if process.poll() is None:
            process.kill()
        process.wait(DEADLINE_S)

    def start_master(self, use_sim_time=True):
        self.start("rosmaster", "--core", "-p", self.uri.rsplit(":", 1)[1])
        self.master = rosgraph.Master("/first_clock_test", master_uri=self.uri)

        def answers():
            try:
                self.master.getPid()
            except OSError:
                return False
            return True

        wait_until(answers, "the master", DEADLINE_S)
        if use_sim_time:
            self.master.setParam("/use_sim_time", True)

    def start_world(self, start_s=START_S, paused=False):
        return self.start(sys.executable, str(HERE / "fake_world.py"), "_start_s:=%s" % start_s,
                          "_paused:=%s" % str(paused).lower())

    def wait_for_text(self, process, text):
        wait_until(lambda: text in process.output(), lambda: "%r in: %s" % (text, process.output()), DEADLINE_S)

    def wait_for_clock(self):
        wait_until(lambda: "/clock" in dict(self.master.getPublishedTopics("")), "/clock", DEADLINE_S)

    def expect_success(self, client):
        self.assertEqual(client.wait(DEADLINE_S), 0, client.output())
        self.assertNotIn("node at 0.000", client.output())
        self.assertIn("joint states at", client.output())

    def test_world_that_has_run_for_long(self):
        self.start_master()
        self.start_world()
        self.wait_for_clock()
        for python in PYTHONS:
            client = self.start(python, str(CLIENT))
            self.expect_success(client)
            self.assertNotIn("waiting", client.output())

    def test_program_started_before_the_world_says_once_what_it_waits_for(self):
        self.start_master()
        client = self.start(sys.executable, str(CLIENT))
        self.wait_for_text(client, "waiting for the first message on /clock, since /use_sim_time is true ...\n")
        self.start_world()
        self.expect_success(client)
        self.assertEqual(client.output().count("waiting"), 1, client.output())

    def test_program_started_before_the_master_takes_simulated_time(self):
        client = self.start(sys.executable, str(CLIENT))
        self.wait_for_text(client, "waits for it")
        self.start_master(use_sim_time=False)
        wait_until(lambda: self.master.getSystemState()[2], "the client's registration", DEADLINE_S)
        self.master.setParam("/use_sim_time", True)
        self.start_world()
        self.expect_success(client)

    def test_robot_that_is_being_put_into_the_world_is_waited_for(self):
        self.start_master()
        self.start_world()
        self.wait_for_clock()
        spawner = self.start(sys.executable, "-c", SPAWNER)
        self.wait_for_text(spawner, "at work")
        client = self.start(sys.executable, str(CLIENT))
        self.wait_for_text(client, "waiting for the simulator, which is starting (/urdf_spawner)")
        self.assertNotIn("node at", client.output())
        spawner.send_signal(signal.SIGINT)
        self.expect_success(client)

    def test_simulator_that_dies_is_named(self):
        self.start_master()
        world = self.start_world()
        self.wait_for_clock()
        spawner = self.start(sys.executable, "-c", SPAWNER)
        self.wait_for_text(spawner, "at work")
        client = self.start(sys.executable, str(CLIENT))
        self.wait_for_text(client, "waiting for the simulator")
        world.kill()
        self.wait_for_text(client, "the simulator (/gazebo) ended while it was waited for")

    def test_nobody_with_a_clock_is_no_hang(self):
        self.start_master()
        node = self.start(sys.executable, "-c", ONE_NODE)
        self.assertEqual(node.wait(DEADLINE_S), 0)
        self.assertIn("node at 0.0", node.output())
        self.assertIn("rosparam set use_sim_time false", node.output())

    def test_a_world_that_is_paused_at_its_beginning_is_no_hang(self):
        self.start_master()
        self.start_world(start_s=0.0, paused=True)
        self.wait_for_clock()
        node = self.start(sys.executable, "-c", ONE_NODE)
        self.assertEqual(node.wait(DEADLINE_S), 0)
        self.assertNotIn("rosparam set use_sim_time false", node.output())

    def test_those_that_publish_the_clock_do_not_wait_for_themselves(self):
        self.start_master()
        node = self.start(sys.executable, "-c", OWN_CLOCK)
        self.assertEqual(node.wait(DEADLINE_S), 0)
        self.assertIn("node at 0.0", node.output())
        self.assertNotIn("/use_sim_time", node.output())

    def test_wall_time_and_a_second_call_cost_nothing(self):
        self.start_master(use_sim_time=False)
        node = self.start(sys.executable, "-c", TWICE)
        self.assertEqual(node.wait(DEADLINE_S), 0)
        self.assertIn("again", node.output())
        self.assertNotIn("waiting", node.output())

    def test_ros_own_tools_do_not_wait(self):
        self.start_master()
        echo = self.start("rostopic", "echo", "-n", "1", "/clock")
        wait_until(lambda: "/clock" in dict(self.master.getSystemState()[1]), "rostopic's subscription", DEADLINE_S)
        self.start_world()
        self.assertEqual(echo.wait(DEADLINE_S), 0, echo.output())
        self.assertNotIn("waiting", echo.output())


if __name__ == "__main__":
    import rostest
    rostest.rosrun("rospy_fixes", "first_clock", "__main__")
