#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator among other processes: a second one, stopped listeners, no display, and its end."""
import os
import signal
import subprocess
import sys
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import rostest
from gazebo_msgs.srv import GetWorldProperties

from lab_testing.waiting import wait_until
from processes.ports import free_port
from world_picture import snapshot

DEADLINE_S = 60.0
# A subscriber of /clock that stops itself, as Ctrl-Z would, after the first message.
STOPPED_LISTENER = """
import os, signal, rospy
from rosgraph_msgs.msg import Clock
rospy.init_node("stopped_listener", anonymous=True, disable_rostime=True)
rospy.wait_for_message("/clock", Clock, 60.0)
subscriber = rospy.Subscriber("/clock", Clock, lambda _: os.kill(os.getpid(), signal.SIGSTOP))
rospy.spin()
"""


def state_of(process):
    """The kernel's letter for a process: T is stopped."""
    return Path("/proc/%d/stat" % process.pid).read_text(encoding="ascii").rpartition(")")[2].split()[0]


def snapshot_folders(pid):
    """Those of one simulator: other labs of this machine come and go meanwhile."""
    return list(snapshot._shared_memory_folder().glob("%s%d-%d-*" % (snapshot._PREFIX, os.getuid(), pid)))


class GazeboProcesses(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.world_properties = rospy.ServiceProxy("/gazebo/get_world_properties", GetWorldProperties)
        cls.world_properties.wait_for_service(DEADLINE_S)

    def test_a_second_simulator_says_how_to_stop_the_first_and_leaves_it_alone(self):
        second = subprocess.run(["rosrun", "gazebo_ros", "gzserver", "__name:=gazebo"], capture_output=True, text=True,
                                timeout=DEADLINE_S, check=False)
        self.assertNotEqual(second.returncode, 0)
        self.assertIn("rosnode kill /gazebo", second.stderr)
        before = self.world_properties().sim_time
        wait_until(lambda: self.world_properties().sim_time > before, "the first simulator to go on")

    def test_a_stopped_listener_does_not_hold_up_the_world(self):
        listeners = [subprocess.Popen([sys.executable, "-c", STOPPED_LISTENER]) for _ in range(2)]
        try:
            for listener in listeners:
                wait_until(lambda listener=listener: state_of(listener) == "T", "a listener to stop itself")
            end = self.world_properties().sim_time + 2.0
            wait_until(lambda: self.world_properties().sim_time > end, "two seconds of simulation")
        finally:
            for listener in listeners:
                listener.kill()
                listener.wait()

    def test_the_window_without_a_display_ends_with_a_line(self):
        environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
        for extra in ({}, {"DISPLAY": ":4711"}):
            window = subprocess.run(["rosrun", "gazebo_ros", "gazebo_gui"], env={**environment, **extra},
                                    capture_output=True, text=True, timeout=DEADLINE_S, check=False)
            self.assertEqual(window.returncode, 0)
            self.assertIn("without a window", window.stdout)

    def test_an_interrupted_launch_leaves_nothing(self):
        port = free_port()
        environment = {**os.environ, "ROS_MASTER_URI": "http://localhost:%d" % port, "ROS_HOSTNAME": "localhost"}
        environment.pop("ROS_NAMESPACE", None)
        launch = subprocess.Popen(["roslaunch", "-p", str(port), "gazebo_ros", "empty_world.launch", "gui:=false"],
                                  env=environment, start_new_session=True, stdout=subprocess.DEVNULL)
        try:
            master = rosgraph.Master("/gazebo_processes_test", "http://localhost:%d" % port)

            def has_clock():
                try:
                    return any(topic == "/clock" for topic, _ in master.getPublishedTopics(""))
                except (OSError, rosgraph.MasterException):
                    return False

            wait_until(has_clock, "the launched simulator", DEADLINE_S)
            pid = ServerProxy(master.lookupNode("/gazebo")).getPid("/gazebo_processes_test")[2]
            self.assertEqual(len(snapshot_folders(pid)), 1)
            launch.send_signal(signal.SIGINT)
            self.assertEqual(launch.wait(DEADLINE_S), 0)
            self.assertEqual(snapshot_folders(pid), [])
            ours = "ROS_MASTER_URI=http://localhost:%d" % port
            wait_until(lambda: not processes_with(ours), "all processes of the launch to be gone", DEADLINE_S)
        finally:
            if launch.poll() is None:
                os.killpg(launch.pid, signal.SIGKILL)
                launch.wait()


def processes_with(setting):
    """Living processes that have ``setting`` in their environment."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if setting.encode() in path.read_bytes().split(b"\0"):
                found.append(path.parent.name)
        except OSError:
            continue
    return found


if __name__ == "__main__":
    rospy.init_node("gazebo_processes_test", disable_rostime=True)
    rostest.rosrun("gazebo_ros", "gazebo_processes", GazeboProcesses)
