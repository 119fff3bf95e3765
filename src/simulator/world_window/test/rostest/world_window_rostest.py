#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The window under the hands of a user: mouse and keys of a virtual screen, and what they do in the world."""
import functools
import os
import subprocess
import unittest

import numpy as np
import rospy
import rostest
from gazebo_msgs.srv import DeleteModel, GetModelState, GetPhysicsProperties, GetWorldProperties, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import Image

from lab_testing import screen_input, skipping, virtual_screen, waiting

BLOCK = """<robot name="block"><link name="body">
  <inertial><mass value="1"/><inertia ixx="0.0067" iyy="0.0067" izz="0.0067" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><box size="0.2 0.2 0.2"/></geometry><material name="red"><color rgba="1 0 0 1"/></material></visual>
  <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link></robot>"""
STEP_S = 0.001
DEADLINE_S = 100.0
wait_until = functools.partial(waiting.wait_until, timeout_s=DEADLINE_S, interval_s=0.1)


def red_of(picture):
    """Rows and columns of the red pixels of a picture (height, width, 3)."""
    picture = picture.astype(int)
    return np.nonzero((picture[..., 0] > 90) & (picture[..., 1:].max(axis=-1) < 40))


class WorldWindow(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for name, kind in (("delete_model", DeleteModel), ("get_model_state", GetModelState),
                           ("get_physics_properties", GetPhysicsProperties),
                           ("get_world_properties", GetWorldProperties), ("spawn_urdf_model", SpawnModel)):
            service = rospy.ServiceProxy("/gazebo/" + name, kind)
            service.wait_for_service(DEADLINE_S)
            setattr(cls, name, staticmethod(service))

    def open_window(self):
        if not screen_input.is_there():
            skipping.skip(self, screen_input.MISSING)
        self._screen = virtual_screen.open_for(self)
        self.input = screen_input.ScreenInput(self._screen)
        self.addCleanup(self.input.close)
        self.window = subprocess.Popen(["rosrun", "gazebo_ros", "gzclient"], env=self._screen.environment)
        self.addCleanup(self.window.wait)
        self.addCleanup(self.window.terminate)
        wait_until(lambda: len(self.red()[0]) > 1000, "a red block in the window")

    def setUp(self):
        pose = Pose(Point(0.0, 0.0, 0.1), Quaternion(0, 0, 0, 1))
        self.assertTrue(self.spawn_urdf_model("block", BLOCK, "", pose, "").success)
        self.addCleanup(self.delete_model, "block")

    def test_without_a_screen_the_pictures_are_a_topic(self):
        environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
        window = subprocess.Popen(["rosrun", "gazebo_ros", "gzclient", "_offscreen:=true"], env=environment)
        self.addCleanup(window.wait)
        self.addCleanup(window.terminate)
        message = rospy.wait_for_message("/gazebo_gui/image", Image, DEADLINE_S)
        picture = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
        self.assertGreater(len(red_of(picture)[0]), 1000)
        window.terminate()
        self.assertEqual(window.wait(DEADLINE_S), 0)

    def test_a_second_window_leaves_the_first_one_open(self):
        def windows():
            return {name.rpartition("/")[0] for name, _ in rospy.get_published_topics() if "/gazebo_gui" in name}

        opened = []
        for count in (1, 2):
            window = subprocess.Popen(["rosrun", "gazebo_ros", "gzclient", "_offscreen:=true"])
            self.addCleanup(window.wait)
            self.addCleanup(window.terminate)
            opened.append(window)
            wait_until(lambda count=count: len(windows()) == count, "%d windows: %s" % (count, windows()))
        for name in windows():
            rospy.wait_for_message(name + "/image", Image, DEADLINE_S)
        self.assertEqual([window.poll() for window in opened], [None, None])

    def red(self):
        """Rows and columns of the red pixels on the screen."""
        return red_of(self._screen.picture())

    def middle(self):
        """x, y of the middle of the block on the screen."""
        rows, columns = self.red()
        return columns.mean(), rows.mean()

    def place(self):
        position = self.get_model_state("block", "").pose.position
        return np.array([position.x, position.y, position.z])

    def test_a_user_pulls_pauses_steps_resets_zooms_deletes_and_closes(self):
        self.open_window()
        start = self.place()

        x, y = self.middle()
        self.input.move(x, y)
        self.input.key("Control_L", True)
        self.input.button(screen_input.LEFT, True)
        for part in np.linspace(0.0, 1.0, 11):
            self.input.move(x + 120 * part, y - 150 * part)
        wait_until(lambda: self.place()[2] > start[2] + 0.05 and np.hypot(*(self.place() - start)[:2]) > 0.03,
                   "the pulled block in the air, aside")
        self.input.button(screen_input.LEFT, False)
        self.input.key("Control_L", False)
        wait_until(lambda: abs(self.place()[2] - start[2]) < 0.01, "the block on the floor again")

        self.input.type("space")
        wait_until(lambda: self.get_physics_properties().pause, "a pause by the key")
        before = self.get_world_properties().sim_time
        self.input.type("period")
        wait_until(lambda: self.get_world_properties().sim_time > before, "a step by the key")
        self.assertAlmostEqual(self.get_world_properties().sim_time, before + STEP_S, places=6)

        self.input.type("Control_L", "r")
        wait_until(lambda: np.allclose(self.place(), start, atol=1e-3), "the block at its start")
        self.assertGreater(self.get_world_properties().sim_time, before)
        self.input.type("Control_L", "Shift_L", "r")
        wait_until(lambda: self.get_world_properties().sim_time < before, "the time at zero")
        # The window shows what it is told by the world, so the key means the other thing now.
        self.input.type("space")
        wait_until(lambda: not self.get_physics_properties().pause, "the world going on")

        x, y = self.middle()
        size = len(self.red()[0])
        self.input.move(x, y)
        for _ in range(3):
            self.input.click(x, y, screen_input.WHEEL_UP)
        wait_until(lambda: len(self.red()[0]) > 1.3 * size, "a nearer view")

        self.input.click(*self.middle())
        self.input.type("Delete")
        wait_until(lambda: "block" not in self.get_world_properties().model_names, "the block deleted")
        wait_until(lambda: not len(self.red()[0]), "no block in the window")

        self.input.type("Control_L", "q")
        self.assertEqual(self.window.wait(DEADLINE_S), 0)
        before = self.get_world_properties().sim_time
        wait_until(lambda: self.get_world_properties().sim_time > before, "the world going on without its window")


if __name__ == "__main__":
    rospy.init_node("world_window_rostest", disable_rostime=True)
    rostest.rosrun("world_window", "world_window", WorldWindow)
