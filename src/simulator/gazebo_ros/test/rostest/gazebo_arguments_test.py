#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The arguments of empty_world.launch: paused, another world, twice as fast, a slower clock, no window."""
import subprocess
import unittest

import rosgraph
import rospy
import rostest
from gazebo_msgs.srv import GetPhysicsProperties, GetWorldProperties
from rosgraph_msgs.msg import Clock

from lab_testing.waiting import wait_until

BALL = """<robot name="ball"><link name="body"><inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
DEADLINE_S = 90.0


class GazeboArguments(unittest.TestCase):
    def test_arguments(self):
        physics = rospy.ServiceProxy("/gazebo/get_physics_properties", GetPhysicsProperties)
        world = rospy.ServiceProxy("/gazebo/get_world_properties", GetWorldProperties)
        physics.wait_for_service(DEADLINE_S)
        properties = physics()
        self.assertTrue(properties.pause)
        self.assertEqual(properties.gravity.z, -1.62)
        self.assertEqual(properties.time_step, 0.001)
        self.assertEqual((world().sim_time, list(world().model_names)), (0.0, []))
        nodes = {node for topics in rosgraph.Master("/test").getSystemState() for _, names in topics for node in names}
        self.assertNotIn("/gazebo_gui", nodes)

        stamps = []
        subscriber = rospy.Subscriber("/clock", Clock, lambda message: stamps.append(message.clock.to_nsec()))
        command = ["rosrun", "gazebo_ros", "spawn_model", "-urdf", "-stdin", "-model", "ball", "-z", "50", "-unpause"]
        spawned = subprocess.run(command, input=BALL, text=True, timeout=DEADLINE_S, check=False)
        self.assertEqual(spawned.returncode, 0)
        self.assertFalse(physics().pause)
        self.assertAlmostEqual(properties.max_update_rate, 2.0 / properties.time_step)
        wait_until(lambda: world().sim_time >= 1.0, "a second of simulation")
        subscriber.unregister()
        moving = [stamp for stamp in stamps if stamp > 0]
        self.assertGreater(len(moving), 50, "clock messages in a second of simulation")
        # A busy machine skips some when it catches up.
        self.assertEqual({stamp % 10_000_000 for stamp in moving}, {0})


if __name__ == "__main__":
    rospy.init_node("gazebo_arguments_test", disable_rostime=True)
    rostest.rosrun("gazebo_ros", "gazebo_arguments", GazeboArguments)
