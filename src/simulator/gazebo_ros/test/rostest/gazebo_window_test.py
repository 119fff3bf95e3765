#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The window shows what is in the world: looked at in the frame buffer of a virtual display."""
import functools
import subprocess
import unittest

import numpy as np
import rospy
import rostest
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import DeleteModel, GetWorldProperties, SetModelConfiguration, SetModelState, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from std_srvs.srv import Empty

from lab_testing import virtual_screen, waiting

BOX = """<robot name="box"><link name="body">
  <inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry><box size="0.4 0.4 0.4"/></geometry><material name="red"><color rgba="1 0 0 1"/></material></visual>
  <collision><geometry><box size="0.4 0.4 0.4"/></geometry></collision></link>
  <gazebo><static>true</static></gazebo></robot>"""
# A link whose mesh is missing, with the inertia of a box of 20 kg and 0.4 m.
GHOST = BOX.replace('<mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"',
                    '<mass value="20"/><inertia ixx="0.533" iyy="0.533" izz="0.533"')
GHOST = GHOST.replace('<box size="0.4 0.4 0.4"/>', '<mesh filename="package://gone/ghost.stl"/>')
# One link in two colours, the red half below the blue one, and on a slide beside it a green one.
SHAPE = """<visual><origin xyz="%s"/><geometry><box size="0.4 0.4 0.4"/></geometry>
  <material name="%s"><color rgba="%s 1"/></material></visual>"""
PIED = BOX.replace("</visual>", "</visual>" + SHAPE % ("0 0 0.4", "blue", "0 0 1"))
PIED = PIED.replace("</link>", """</link><link name="green">%s
  <inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="body"/><child link="green"/><axis xyz="0 0 1"/>
  <origin xyz="0 0.6 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>""" %
                    SHAPE % ("0 0 0", "green", "0 1 0"))
DEADLINE_S = 60.0
wait_until = functools.partial(waiting.wait_until, timeout_s=DEADLINE_S, interval_s=0.2)


class GazeboWindow(unittest.TestCase):
    def setUp(self):
        self._screen = virtual_screen.open_for(self)

    def open_window(self):
        window = subprocess.Popen(["rosrun", "gazebo_ros", "gazebo_gui"], env=self._screen.environment)
        self.addCleanup(window.wait)
        self.addCleanup(window.terminate)

    def seen(self, channel):
        """Rows and columns of the pixels in one pure colour, 0 for red, 1 for green, 2 for blue."""
        image = self._screen.picture().astype(int)
        others = [other for other in range(3) if other != channel]
        return np.nonzero((image[..., channel] > 90) & (image[..., others].max(axis=-1) < 40))

    def red(self):
        return self.seen(0)

    def test_models_appear_move_and_disappear_and_the_world_keeps_its_pace(self):
        services = {}
        for name, srv_class in (("spawn_urdf_model", SpawnModel), ("delete_model", DeleteModel),
                                ("set_model_state", SetModelState), ("get_world_properties", GetWorldProperties),
                                ("set_model_configuration", SetModelConfiguration),
                                ("pause_physics", Empty), ("unpause_physics", Empty)):
            services[name] = rospy.ServiceProxy("/gazebo/" + name, srv_class)
            services[name].wait_for_service(DEADLINE_S)
        pose = Pose(Point(0.2, 0.0, 0.9), Quaternion(0, 0, 0, 1))
        self.assertTrue(services["spawn_urdf_model"]("box", BOX, "", pose, "").success)
        self.open_window()
        wait_until(lambda: len(self.red()[0]) > 1000, "a red box in the window")
        row = self.red()[0].mean()

        start = services["get_world_properties"]().sim_time
        pose.position.z = 0.5
        services["set_model_state"](ModelState(model_name="box", pose=pose))
        wait_until(lambda: len(self.red()[0]) > 1000 and self.red()[0].mean() > row + 50, "the box to be seen lower")
        wait_until(lambda: services["get_world_properties"]().sim_time > start + 1.0, "the world to go on meanwhile")

        self.assertTrue(services["delete_model"]("box").success)
        wait_until(lambda: len(self.red()[0]) == 0, "the box to go from the window")

        self.assertTrue(services["spawn_urdf_model"]("ghost", GHOST, "", pose, "").success)
        wait_until(lambda: len(self.red()[0]) > 1000, "a red box for the mesh that is missing")
        self.assertTrue(services["delete_model"]("ghost").success)

        # Paused, or the slide would fall; bodies moved by services are still visible.
        services["pause_physics"]()
        self.assertTrue(services["spawn_urdf_model"]("pied", PIED, "", pose, "").success)
        wait_until(lambda: all(len(self.seen(channel)[0]) > 1000 for channel in range(3)), "a box in three colours")
        self.assertGreater(self.red()[0].mean(), self.seen(2)[0].mean())
        row = self.seen(1)[0].mean()
        self.assertTrue(services["set_model_configuration"]("pied", "", ["slide"], [0.4]).success)
        wait_until(lambda: len(self.seen(1)[0]) > 1000 and self.seen(1)[0].mean() < row - 40, "green to be seen higher")
        services["unpause_physics"]()
        self.assertTrue(services["delete_model"]("pied").success)


if __name__ == "__main__":
    rospy.init_node("gazebo_window_test", disable_rostime=True)
    rostest.rosrun("gazebo_ros", "gazebo_window", GazeboWindow)
