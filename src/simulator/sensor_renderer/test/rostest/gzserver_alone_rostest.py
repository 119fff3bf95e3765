#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A simulator that was started without its launch file shows what its cameras see."""
import functools
import os
import signal
import unittest
import xmlrpc.client

import rosgraph
import rospy
from gazebo_msgs.srv import SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import Image
from std_srvs.srv import Empty

from lab_testing import waiting
from lab_testing.waiting import wait_for_message
from processes.family import is_running

EYE = """<sdf version="1.6"><model name="m"><static>true</static><link name="l"><sensor type="camera" name="eye">
<update_rate>20</update_rate><camera><image><width>160</width><height>120</height></image></camera>
<plugin name="p" filename="libgazebo_ros_camera.so"><cameraName>eye</cameraName></plugin></sensor></link></model>
</sdf>"""
wait_until = functools.partial(waiting.wait_until, timeout_s=60.0)


def api_of(node):
    """The address of a node; None while the master knows none of that name."""
    try:
        return rosgraph.Master("/test").lookupNode(node)
    except rosgraph.MasterError:
        return None


def process_of(node):
    return xmlrpc.client.ServerProxy(api_of(node)).getPid("/test")[2]


class GzserverAlone(unittest.TestCase):
    def test_cameras_have_pictures(self):
        rospy.wait_for_service("/gazebo/spawn_sdf_model", 60.0)
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
        self.assertIsNone(api_of("/sensor_renderer"), "nothing draws while there is no camera")
        spawned = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)(
            "eye", EYE, "", Pose(Point(0, 0, 1), Quaternion(0, 0, 0, 1)), "world")
        self.assertTrue(spawned.success, spawned.status_message)
        self.assertEqual(wait_for_message("/eye/image_raw", Image).width, 160)

        # The renderer is killed; the simulator starts another one.
        old = api_of("/sensor_renderer")
        os.kill(process_of("/sensor_renderer"), signal.SIGKILL)
        wait_until(lambda: api_of("/sensor_renderer") not in (None, old))
        self.assertEqual(wait_for_message("/eye/image_raw", Image).width, 160)

        # It ends with the simulator, even with one that is killed.
        renderer = process_of("/sensor_renderer")
        os.kill(process_of("/gazebo"), signal.SIGKILL)
        wait_until(lambda: not is_running(renderer), "the renderer ends")


if __name__ == "__main__":
    import rostest
    rospy.init_node("gzserver_alone_rostest", disable_rostime=True)
    rostest.rosrun("sensor_renderer", "gzserver_alone", GzserverAlone)
