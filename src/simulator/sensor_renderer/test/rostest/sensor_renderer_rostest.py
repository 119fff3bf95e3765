#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Cameras of SDF and URDF models appear and disappear with their models, and with the simulator."""
import functools
import os
import signal
import unittest
import xmlrpc.client

import numpy as np
import rosgraph
import rospy
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import CameraInfo, Image

from lab_testing import waiting
from lab_testing.waiting import wait_for_message, wait_for_publishers

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
EYE = """<sdf version="1.6"><model name="m"><static>true</static><link name="l"><sensor type="camera" name="eye">
<update_rate>20</update_rate>%s<plugin name="p" filename="libgazebo_ros_camera.so"><cameraName>%s</cameraName></plugin>
</sensor></link></model></sdf>"""
BLOCK = """<sdf version="1.6"><model name="b"><link name="l"><collision name="c">
<geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision><visual name="v"><geometry><box>
<size>0.1 0.1 0.1</size></box></geometry></visual></link></model></sdf>"""
MESH = BLOCK.replace("<box>\n<size>0.1 0.1 0.1</size></box>", "<mesh><uri>file:///nowhere/a.stl</uri></mesh>")
WALL = """<robot name="wall"><link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial><visual><geometry><box size="0.1 4 4"/></geometry><material name="g"><color rgba="0 0.8 0 1"/>
</material></visual></link><gazebo><static>true</static></gazebo></robot>"""
wait_until = functools.partial(waiting.wait_until, timeout_s=60.0)
LEFT, RIGHT, DEEP = "/eyes/left/image_raw", "/eyes/right/image_raw", "/deep/depth/image_raw"


def is_green(image):
    picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3).astype(int)
    return (picture[:, :, 1] > 2 * picture[:, :, 0]).mean() > 0.9


def spawn(kind, name, xml, x):
    rospy.wait_for_service("/gazebo/spawn_%s_model" % kind, 60.0)
    call = rospy.ServiceProxy("/gazebo/spawn_%s_model" % kind, SpawnModel)
    answer = call(name, xml, "", Pose(Point(x, 0.0, 0.0), Quaternion(0, 0, 0, 1)), "world")
    assert answer.success, answer.status_message


class SensorRendererTest(unittest.TestCase):
    def test_1_what_is_of_no_use_blinds_nobody(self):
        said = []
        log = rospy.Subscriber("/rosout", Log, lambda line: said.append(line.msg), queue_size=1000)
        wait_for_publishers(log, "/gazebo", "/sensor_renderer", timeout_s=60.0)
        spawn("sdf", "huge", EYE % (CAMERA.replace(">160<", ">99999999<") % "", "huge"), -1.0)
        spawn("sdf", "nameless", EYE % (CAMERA % "", "no name!"), -2.0)
        spawn("sdf", "mesh", MESH, -3.0)
        spawn("sdf", "first", EYE % (CAMERA % "", "twin"), 5.0)
        spawn("sdf", "second", EYE % (CAMERA % "", "twin"), 7.0)
        for number in range(50):
            spawn("sdf", "block%d" % number, BLOCK, 10.0 + 0.2 * number)
        # Two look at once; a model goes while it is being drawn.
        seen = [[], []]
        looking = [rospy.Subscriber("/twin/image_raw", Image, part.append, queue_size=1) for part in seen]
        wait_until(lambda: min(map(len, seen)) > 3)
        for name in ("second", "mesh", *("block%d" % number for number in range(50))):
            rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)(name)
        counts = [len(part) for part in seen]
        wait_until(lambda: all(len(part) > count + 5 for part, count in zip(seen, counts, strict=True)))
        for text in ("picture of 99999999 x 120 pixels is out of range", "'/no name!/image_raw' is not a name in ROS"):
            wait_until(lambda text=text: any(text in line for line in said), text)
            self.assertEqual(sum(text in line for line in said), 1, "said once: %s" % text)

        # The renderer is killed; it is restarted and goes on.
        old = api_of("/sensor_renderer")
        os.kill(xmlrpc.client.ServerProxy(old).getPid("/test")[2], signal.SIGKILL)
        wait_until(lambda: api_of("/sensor_renderer") not in (None, old))
        last = [part[-1].header.stamp for part in seen]
        wait_until(lambda: all(part[-1].header.stamp > stamp for part, stamp in zip(seen, last, strict=True)))
        for subscriber in (log, *looking):
            subscriber.unregister()
        for name in ("huge", "nameless", "first"):
            rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)(name)

    def test_2_models_and_simulators_come_and_go(self):
        spawn("sdf", "rig", RIG, 0.0)
        # One sensor of this model has no <camera>: the others work.
        first = wait_for_message(LEFT, Image)
        self.assertEqual((first.width, first.height, first.encoding, first.header.frame_id), (160, 120, "rgb8", "eyes"))
        self.assertFalse(is_green(first))
        self.assertAlmostEqual(wait_for_message("/eyes/left/camera_info", CameraInfo).K[0], 80.0 / np.tan(0.5), 3)
        rendered_by = api_of("/sensor_renderer")

        spawn("urdf", "wall", WALL, 2.0)
        for topic in (LEFT, RIGHT):
            wait_for_message(topic, Image, is_green)
        deep = wait_for_message(DEEP, Image, lambda image: image.encoding == "16UC1")
        depth = np.frombuffer(deep.data, np.uint16)
        self.assertTrue(np.all(np.abs(depth.astype(int) - 1950) < 5), "the wall's face is at 1.95 m")
        rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)("wall")
        wait_for_message(LEFT, Image, lambda image: not is_green(image))

        # The simulator is killed and restarts with an empty world; the same renderer draws the new world.
        old = api_of("/gazebo")
        os.kill(xmlrpc.client.ServerProxy(old).getPid("/test")[2], signal.SIGKILL)
        wait_until(lambda: api_of("/gazebo") not in (None, old))
        spawn("urdf", "wall", WALL, 2.0)
        spawn("sdf", "rig", RIG, 0.0)
        wait_for_message(LEFT, Image, is_green)
        self.assertEqual(api_of("/sensor_renderer"), rendered_by)


def api_of(node):
    """The address of a node; None while the master knows none of that name."""
    try:
        return rosgraph.Master("/test").lookupNode(node)
    except rosgraph.MasterError:
        return None


if __name__ == "__main__":
    import rostest
    rospy.init_node("sensor_renderer_rostest")
    rostest.rosrun("sensor_renderer", "cameras_of_models", SensorRendererTest)
