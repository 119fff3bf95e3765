#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A lab that is launched twice on one master: the second launch changes nothing, and a dead simulator does not block a
new one."""
import contextlib
import os
import shutil
import signal
import subprocess
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph
import rostest

from lab_testing.waiting import wait_until
from processes.ports import free_port

DEADLINE_S = 60.0
# ROS's own, called by its full path.
ROSLAUNCH = shutil.which("roslaunch")
LAB = str(Path(__file__).resolve().parent / "second_lab.launch")
OTHER = """<launch>
  <node name="other" pkg="tf2_ros" type="static_transform_publisher" args="0 0 0 0 0 0 base tool"/>
</launch>"""


class SecondLaunch(unittest.TestCase):
    def setUp(self):
        self.uri = "http://localhost:%d" % free_port()
        self.environment = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_HOSTNAME": "localhost"}
        self.environment.pop("ROS_NAMESPACE", None)
        self.master = rosgraph.Master("/second_launch_test", self.uri)

    def launch(self, *arguments):
        launch = subprocess.Popen([ROSLAUNCH, *arguments], env=self.environment, start_new_session=True,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        self.addCleanup(end, launch)
        return launch

    def check_refused(self):
        second = subprocess.run([ROSLAUNCH, LAB, "mark:=second"], env=self.environment, capture_output=True,
                                text=True, timeout=DEADLINE_S, check=False)
        self.assertEqual(second.returncode, 1, second.stdout)
        # Two that start at once may want to make the link to the newest logs at the same time.
        said = [line for line in second.stderr.splitlines() if "symlink to latest log directory" not in line]
        self.assertEqual(len(said), 3, second.stderr)
        self.assertIn("/gazebo", second.stderr)
        self.assertIn("To stop it", second.stderr)
        self.assertNotIn("process[", second.stdout)
        return second.stderr

    def pid(self, node):
        """The process of a node, None where it is not registered or does not answer."""
        with contextlib.suppress(OSError, rosgraph.MasterException):
            return ServerProxy(self.master.lookupNode(node)).getPid("/second_launch_test")[2]
        return None

    def test_a_second_lab_is_refused_while_the_first_starts_and_while_it_runs(self):
        first = self.launch(LAB)
        wait_until(lambda: self.pid("/companion") or self.pid("/gazebo"), "the first lab to begin", DEADLINE_S)
        self.check_refused()
        wait_until(lambda: self.pid("/gazebo") and self.pid("/companion"), "the first lab", DEADLINE_S)
        nodes = self.pid("/gazebo"), self.pid("/companion")
        said = self.check_refused()
        self.assertIn("rosnode kill /gazebo", said)
        self.assertIn("process %d" % nodes[0], said)
        self.assertEqual((self.pid("/gazebo"), self.pid("/companion")), nodes)
        self.assertEqual(self.master.getParam("/mark"), "first")
        self.assertIsNone(first.poll())

        # A launch file without a simulator may start.
        other = subprocess.Popen([ROSLAUNCH, "-"], env=self.environment, start_new_session=True,
                                 stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        self.addCleanup(end, other)
        other.stdin.write(OTHER)
        other.stdin.close()
        wait_until(lambda: self.pid("/other"), "another launch file's node", DEADLINE_S)
        self.assertEqual((self.pid("/gazebo"), self.pid("/companion")), nodes)

        # The simulator dies, its registration stays, and the launch goes on with the rest.
        os.kill(nodes[0], signal.SIGKILL)
        wait_until(lambda: self.pid("/gazebo") is None, "the simulator to be gone", DEADLINE_S)
        self.assertTrue(self.master.lookupNode("/gazebo"))
        self.assertIsNone(first.poll())
        self.launch(LAB, "mark:=third")
        wait_until(lambda: self.pid("/gazebo"), "a new simulator in its place", DEADLINE_S)
        self.assertEqual(self.master.getParam("/mark"), "third")

    def test_nothing_is_started_where_another_launch_is_about_to(self):
        launches = [self.launch(LAB, "mark:=%d" % number) for number in range(3)]
        wait_until(lambda: [launch.poll() for launch in launches].count(None) == 1, "all but one to end", DEADLINE_S)
        wait_until(lambda: self.pid("/gazebo") and self.pid("/companion"), "the lab that is left", DEADLINE_S)
        self.assertEqual([launch.poll() for launch in launches].count(1), 2)


def end(launch):
    """Ctrl-C, and more where that is not enough."""
    if launch.poll() is None:
        launch.send_signal(signal.SIGINT)
        try:
            launch.wait(DEADLINE_S)
        except subprocess.TimeoutExpired:
            os.killpg(launch.pid, signal.SIGKILL)
            launch.wait()


if __name__ == "__main__":
    rostest.rosrun("gazebo_ros", "second_launch", SecondLaunch)
