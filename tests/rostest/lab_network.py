#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""In sim mode the lab listens on 127.0.0.1 only, except for the ports in docs/security.md; and the doctor finds no
problem."""

import subprocess
import sys
import unittest
from pathlib import Path

import rosgraph
import rospy
import rostest
from std_msgs.msg import Empty

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from lab_doctor import probe  # noqa: E402  (the tools are not installed package)

# Debian's C++ nodes: roscpp opens its XML-RPC port on all addresses.
KNOWN_OPEN = {"rosout", "base_to_world"}


def port_of(uri):
    return int(uri.rstrip("/").rsplit(":", 1)[1])


def environment_of(pid):
    try:
        return Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return []


class LabNetwork(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("lab_network", disable_rostime=True)
        rospy.wait_for_message("/robot/sim/started", Empty, timeout=90)

    def own_listeners(self):
        """Open ports of this lab's processes alone: known by this test's master."""
        uri = f"ROS_MASTER_URI={rosgraph.get_master_uri()}".encode().rstrip(b"/")
        listeners = probe.list_listeners()
        return [one for one in listeners if any(text.rstrip(b"/") == uri for text in environment_of(one.pid))]

    def test_only_the_named_nodes_are_open_to_other_machines(self):
        found = {one.process for one in self.own_listeners()}
        self.assertLessEqual(found, KNOWN_OPEN)
        # base_to_world is: if it is not found, this test checks the wrong processes.
        self.assertIn("base_to_world", found)

    def test_master_and_simulator_listen_on_loopback(self):
        _, _, gazebo_uri = rospy.get_master().lookupNode("/gazebo")
        for port in (port_of(rosgraph.get_master_uri()), port_of(gazebo_uri)):
            lines = subprocess.run(
                ["ss", "-Hltn", f"sport = :{port}"], capture_output=True, text=True, check=True
            ).stdout.splitlines()
            self.assertEqual([line.split()[3] for line in lines], [f"127.0.0.1:{port}"])

    def test_doctor_finds_the_running_lab_healthy(self):
        done = subprocess.run(
            [sys.executable, str(ROOT / "tools/doctor.py")], capture_output=True, text=True, timeout=120, check=False
        )
        for line in ("ok    master", "ok    clock      simulation time advances", "ok    python", "enable_robot.py -e"):
            self.assertIn(line, done.stdout)
        self.assertNotIn("WRONG simulator", done.stdout)


if __name__ == "__main__":
    rostest.rosrun("workspace_tests", "lab_network", LabNetwork)
