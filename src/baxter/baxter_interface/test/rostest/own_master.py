# SPDX-License-Identifier: BSD-3-Clause
"""For tests that start and end the master and the robot."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosgraph

from lab_testing.waiting import wait_until
from processes.ports import free_port

DEADLINE_S = 60.0
# Time for a process to end before it is killed [s].
END_S = 10.0
FAKE_ROBOT = pathlib.Path(__file__).with_name("fake_robot.py")


class OwnMasterTest(unittest.TestCase):
    """A test that starts, and can end, its master and its robot itself."""

    def setUp(self):
        self.uri = "http://localhost:%d" % free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI=self.uri, ROS_HOSTNAME="localhost", PYTHONUNBUFFERED="1")
        self.environment.pop("ROS_NAMESPACE", None)

    def start(self, *command, **environment):
        """Start a process that ends with the test; its output goes to a file."""
        output = tempfile.NamedTemporaryFile("w+")
        self.addCleanup(output.close)
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT,
                                   env=dict(self.environment, **environment))
        process.output = lambda: pathlib.Path(output.name).read_text()

        self.addCleanup(self.end, process)
        return process

    def end(self, process):
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            # rospy shuts a node down inside its signal handler, which may wait for a lock that it interrupted.
            process.kill()
            process.wait(DEADLINE_S)

    def start_master(self):
        process = self.start("rosmaster", "--core", "-p", self.uri.rsplit(":", 1)[1])
        self.master = rosgraph.Master("/own_master_test", master_uri=self.uri)
        wait_until(self.master_is_up, "the master", DEADLINE_S)
        return process

    def master_is_up(self):
        try:
            self.master.getPid()
        except OSError:
            return False
        return True

    def start_robot(self, **knobs):
        return self.start(sys.executable, str(FAKE_ROBOT), *("_%s:=%s" % knob for knob in knobs.items()))

    def start_ready_robot(self, **knobs):
        """A robot that publishes already, for programs that do not wait long."""
        process = self.start_robot(**knobs)
        wait_until(lambda: "/robot/state" in dict(self.master.getPublishedTopics("")), "the robot", DEADLINE_S)
        return process

    def wait_for_text(self, process, text):
        wait_until(lambda: text in process.output(), lambda: "%r in: %s" % (text, process.output()), DEADLINE_S)
