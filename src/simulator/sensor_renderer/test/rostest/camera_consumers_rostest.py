#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""depth_image_proc makes the same points of our depth that we do; image_view shows the picture that was sent."""
import os
import signal
import subprocess
import threading
import unittest

import numpy as np
import rospy
from gazebo_msgs.srv import SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import Image, PointCloud2

from lab_testing import virtual_screen
from lab_testing.waiting import wait_until

RIG = """<sdf version="1.6"><model name="rig"><static>true</static><link name="post"><pose>0 0 1 0 0.3 0</pose>
<sensor type="depth" name="depth"><update_rate>10</update_rate><camera><horizontal_fov>1.0</horizontal_fov>
<image><width>320</width><height>240</height></image><clip><near>0.05</near><far>8</far></clip></camera>
<plugin name="p" filename="libgazebo_ros_openni_kinect.so"><cameraName>deep</cameraName>
<frameName>deep_optical</frameName><pointCloudCutoff>0.4</pointCloudCutoff></plugin></sensor></link></model></sdf>"""
CUBE = """<sdf version="1.6"><model name="cube"><static>true</static><link name="l"><visual name="v"><geometry><box>
<size>0.4 0.4 0.4</size></box></geometry><material><ambient>0.9 0 0 1</ambient><diffuse>0.9 0 0 1</diffuse></material>
</visual></link></model></sdf>"""
CLOUDS = ("/deep/depth/points", "/xyz/points", "/xyzrgb/points")
TIMEOUT_S = 60.0


def spawn(name, xml, x, z):
    rospy.wait_for_service("/gazebo/spawn_sdf_model", TIMEOUT_S)
    answer = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)(
        name, xml, "", Pose(Point(x, 0.0, z), Quaternion(0, 0, 0, 1)), "world")
    assert answer.success, answer.status_message


def field(cloud, name, kind):
    """(height, width) of one field of a PointCloud2."""
    raw = np.frombuffer(cloud.data, np.uint8).reshape(cloud.height, cloud.width, cloud.point_step)
    start = {field.name: field.offset for field in cloud.fields}[name]
    return np.ascontiguousarray(raw[:, :, start:start + 4]).view(kind)[:, :, 0]


def red_box(picture):
    """Width and height [pixels] of the red area in (height, width, 3), and the red fraction of its box."""
    red = (picture[:, :, 0] > 80) & (picture[:, :, 1] < 20) & (picture[:, :, 2] < 20)
    rows, columns = np.nonzero(red)
    return (int(np.ptp(columns)), int(np.ptp(rows)), len(rows)) if len(rows) else (0, 0, 0)


class CameraConsumersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        spawn("cube", CUBE, 2.0, 0.3)
        spawn("rig", RIG, 0.0, 0.0)

    def test_depth_image_proc_makes_the_same_points(self):
        kept, triple, enough = {}, [], threading.Event()
        lock = threading.Lock()

        def take(message, topic):
            with lock:
                kept.setdefault(message.header.stamp, {})[topic] = message
                for stamp in sorted(kept)[:-50]:
                    del kept[stamp]
                if len(kept.get(message.header.stamp, ())) == len(CLOUDS) and not triple:
                    triple.extend(kept[message.header.stamp][name] for name in CLOUDS)
                    enough.set()

        subscribers = [rospy.Subscriber(topic, PointCloud2, take, topic, queue_size=5, buff_size=1 << 24)
                       for topic in CLOUDS]
        self.assertTrue(enough.wait(TIMEOUT_S), "no three clouds of one moment; seen of each moment: %s" % [
            sorted(found) for found in list(kept.values())[-3:]])
        for subscriber in subscribers:
            subscriber.unregister()
        ours, plain, coloured = triple
        valid = np.isfinite(field(ours, "z", np.float32))
        self.assertTrue(0.2 < valid.mean() < 1.0, "the picture holds both points and emptiness")
        for theirs in (plain, coloured):
            self.assertEqual((theirs.header.frame_id, theirs.width, theirs.height), ("deep_optical", 320, 240))
            for axis in "xyz":
                mine, other = (field(cloud, axis, np.float32) for cloud in (ours, theirs))
                self.assertTrue(np.array_equal(np.isfinite(other), valid), "a point here is a point there")
                self.assertLess(np.abs(mine - other)[valid].max(), 1e-5)
        colours = [field(cloud, "rgb", np.uint32)[valid] & 0xFFFFFF for cloud in (ours, coloured)]
        self.assertTrue(np.array_equal(*colours))
        red = (colours[0] >> 16 > 80) & (colours[0] & 0xFFFF == 0)
        self.assertGreater(np.count_nonzero(red), 500, "the cube is red")

    def test_image_view_shows_the_picture(self):
        sent = red_box(self.picture())
        self.assertGreater(sent[2], 500)
        screen = virtual_screen.open_for(self)
        command = ["rosrun", "image_view", "image_view", "image:=/deep/rgb/image_raw", "_autosize:=true"]
        viewer = subprocess.Popen(command, env=screen.environment, start_new_session=True)
        self.addCleanup(viewer.wait, TIMEOUT_S)
        self.addCleanup(os.killpg, viewer.pid, signal.SIGTERM)

        def shown():
            self.assertIsNone(viewer.poll(), "image_view has ended")
            return red_box(screen.picture())

        wait_until(lambda: shown() == sent, lambda: "width, height, pixels %s, not %s" % (sent, shown()), TIMEOUT_S,
                   interval_s=0.2)

    @staticmethod
    def picture():
        message = rospy.wait_for_message("/deep/rgb/image_raw", Image, TIMEOUT_S)
        return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)


if __name__ == "__main__":
    import rostest
    rospy.init_node("camera_consumers_rostest")
    rostest.rosrun("sensor_renderer", "camera_consumers", CameraConsumersTest)
