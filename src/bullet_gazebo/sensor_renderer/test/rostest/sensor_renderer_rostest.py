#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Cameras of SDF and URDF models come and go with their models, and with the simulator."""
import os
import signal
import threading
import time
import unittest
import xmlrpc.client

import numpy as np
import rosgraph
import rospy
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import CameraInfo, Image

CAMERA = """<camera%s><horizontal_fov>1.0</horizontal_fov><image><width>160</width><height>120</height></image>
<clip><near>0.05</near><far>20</far></clip></camera>"""
RIG = """<sdf version="1.6"><model name="rig"><static>true</static><link name="post"><pose>0 0 1 0 0 0</pose>
<sensor type="multicamera" name="eyes"><update_rate>20</update_rate>""" + CAMERA % ' name="left"' + """
<camera name="right"><pose>0 -0.1 0 0 0 0</pose>""" + CAMERA[len("<camera%s>"):] + """
<plugin name="p" filename="libgazebo_ros_multicamera.so"><cameraName>eyes</cameraName>
<frameName>eyes</frameName></plugin></sensor></link>
<link name="blind"><sensor type="camera" name="broken"><plugin name="p" filename="libgazebo_ros_camera.so"/>
</sensor></link>
<link name="deep"><pose>0 0 1 0 0 0</pose><sensor type="depth" name="depth"><update_rate>20</update_rate>""" + (
    CAMERA % "") + """<plugin name="p" filename="libgazebo_ros_depth_camera.so"><cameraName>deep</cameraName>
<useDepth16UC1Format>true</useDepth16UC1Format></plugin></sensor></link></model></sdf>"""
WALL = """<robot name="wall"><link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial><visual><geometry><box size="0.1 4 4"/></geometry><material name="g"><color rgba="0 0.8 0 1"/>
</material></visual></link><gazebo><static>true</static></gazebo></robot>"""
LEFT, RIGHT, DEEP = "/eyes/left/image_raw", "/eyes/right/image_raw", "/deep/depth/image_raw"


def wait_for(topic, message_class, wanted=lambda message: True, timeout_s=60.0):
    found, done = [], threading.Event()

    def take(message):
        if not done.is_set() and wanted(message):
            found.append(message)
            done.set()

    subscriber = rospy.Subscriber(topic, message_class, take, queue_size=1, buff_size=1 << 22)
    try:
        assert done.wait(timeout_s), "no message that fits on %s within %g s" % (topic, timeout_s)
    finally:
        subscriber.unregister()
    return found[0]


def is_green(image):
    picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3).astype(int)
    return (picture[:, :, 1] > 2 * picture[:, :, 0]).mean() > 0.9


def spawn(kind, name, xml, x):
    rospy.wait_for_service("/gazebo/spawn_%s_model" % kind, 60.0)
    call = rospy.ServiceProxy("/gazebo/spawn_%s_model" % kind, SpawnModel)
    answer = call(name, xml, "", Pose(Point(x, 0.0, 0.0), Quaternion(0, 0, 0, 1)), "world")
    assert answer.success, answer.status_message


class SensorRendererTest(unittest.TestCase):
    def test_models_and_simulators_come_and_go(self):
        spawn("sdf", "rig", RIG, 0.0)
        # One sensor of this model has no <camera>: the others see.
        first = wait_for(LEFT, Image)
        self.assertEqual((first.width, first.height, first.encoding, first.header.frame_id), (160, 120, "rgb8", "eyes"))
        self.assertFalse(is_green(first))
        self.assertAlmostEqual(wait_for("/eyes/left/camera_info", CameraInfo).K[0], 80.0 / np.tan(0.5), 3)
        rendered_by = api_of("/sensor_renderer")

        spawn("urdf", "wall", WALL, 2.0)
        for topic in (LEFT, RIGHT):
            wait_for(topic, Image, is_green)
        deep = wait_for(DEEP, Image, lambda image: image.encoding == "16UC1")
        depth = np.frombuffer(deep.data, np.uint16)
        self.assertTrue(np.all(np.abs(depth.astype(int) - 1950) < 5), "the wall's face is at 1.95 m")
        rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)("wall")
        wait_for(LEFT, Image, lambda image: not is_green(image))

        # The simulator dies without a word and comes back empty; a new world is seen by the same renderer.
        old = api_of("/gazebo")
        os.kill(xmlrpc.client.ServerProxy(old).getPid("/test")[2], signal.SIGKILL)
        wait_until(lambda: api_of("/gazebo") not in (None, old))
        spawn("urdf", "wall", WALL, 2.0)
        spawn("sdf", "rig", RIG, 0.0)
        wait_for(LEFT, Image, is_green)
        self.assertEqual(api_of("/sensor_renderer"), rendered_by)


def api_of(node):
    """Where a node listens; None while the master knows none of that name."""
    try:
        return rosgraph.Master("/test").lookupNode(node)
    except rosgraph.MasterError:
        return None


def wait_until(condition, timeout_s=60.0):
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, "not within %g s" % timeout_s
        time.sleep(0.05)


if __name__ == "__main__":
    import rostest
    rospy.init_node("sensor_renderer_rostest")
    rostest.rosrun("sensor_renderer", "cameras_of_models", SensorRendererTest)
