#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A simulated camera through the node, as OpenCV's video reader and curl see it."""
import shutil
import subprocess
import unittest
import urllib.error
import urllib.request

import cv2
import numpy as np
import rospy
from gazebo_msgs.srv import SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion

from lab_testing.skipping import skip
from lab_testing.waiting import stretched, wait_until

TIMEOUT_S = 60.0
TOPIC = "/eye/image_raw"
EYE = """<sdf version="1.6"><model name="eye"><static>true</static><link name="l"><pose>0 0 1 0 0 0</pose>
<sensor type="camera" name="eye"><update_rate>20</update_rate><camera><horizontal_fov>1.0</horizontal_fov>
<image><width>160</width><height>120</height></image><clip><near>0.05</near><far>20</far></clip></camera>
<plugin name="p" filename="libgazebo_ros_camera.so"><cameraName>eye</cameraName></plugin></sensor></link></model>
</sdf>"""
# Left of the middle, and above it.
CUBE = """<sdf version="1.6"><model name="cube"><static>true</static><link name="l"><visual name="v"><geometry><box>
<size>0.4 0.4 0.4</size></box></geometry><material><ambient>0.9 0 0 1</ambient><diffuse>0.9 0 0 1</diffuse></material>
</visual></link></model></sdf>"""


def spawn(name, xml, *place):
    rospy.wait_for_service("/gazebo/spawn_sdf_model", TIMEOUT_S)
    answer = rospy.ServiceProxy("/gazebo/spawn_sdf_model", SpawnModel)(
        name, xml, "", Pose(Point(*place), Quaternion(0, 0, 0, 1)), "world")
    assert answer.success, answer.status_message


def red_middle(picture):
    """The middle of the red area (column, row) as fractions of the picture, blue first; None where there is none."""
    blue, green, red = (picture[:, :, number].astype(int) for number in range(3))
    rows, columns = np.nonzero((red > 60) & (green < red / 2) & (blue < red / 2))
    return (columns.mean() / picture.shape[1], rows.mean() / picture.shape[0]) if len(rows) > 50 else None


class WebVideoServerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        spawn("cube", CUBE, 2.0, 0.4, 1.3)
        spawn("eye", EYE, 0.0, 0.0, 0.0)
        wait_until(lambda: rospy.has_param("/web_video_server/actual_port"), "the server's port", TIMEOUT_S)
        cls.address = "http://127.0.0.1:%d" % rospy.get_param("/web_video_server/actual_port")
        wait_until(lambda: TOPIC in dict(rospy.get_published_topics()), "the camera", TIMEOUT_S)

    def check_shows_the_cube(self, picture, turned=False):
        found = red_middle(picture)
        self.assertIsNotNone(found, "no red in the picture")
        left, up = found[0] < 0.45, found[1] < 0.45
        right, down = found[0] > 0.55, found[1] > 0.55
        self.assertTrue((right and down) if turned else (left and up), found)

    def check_opencv_reads(self, query, shape, turned=False):
        reader = cv2.VideoCapture("%s/stream?topic=%s%s" % (self.address, TOPIC, query))
        self.addCleanup(reader.release)
        for _ in range(3):
            worked, picture = reader.read()
            self.assertTrue(worked)
            self.assertEqual(picture.shape, shape)
            self.check_shows_the_cube(picture, turned)

    def test_opencv_reads_a_stream(self):
        self.check_opencv_reads("", (120, 160, 3))

    def test_opencv_reads_another_size_upside_down(self):
        self.check_opencv_reads("&type=mjpeg&width=80&height=90&quality=60&invert", (90, 80, 3), turned=True)

    def curl(self, address):
        if shutil.which("curl") is None:
            skip(self, "no curl")
        done = subprocess.run(["curl", "-sSf", "--max-time", "%d" % stretched(30), address], capture_output=True,
                              timeout=stretched(40))
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_curl_gets_a_snapshot(self):
        for query, start in (("", b"\xff\xd8"), ("&type=png&width=80&height=60", b"\x89PNG")):
            data = self.curl("%s/snapshot?topic=%s%s" % (self.address, TOPIC, query))
            self.assertTrue(data.startswith(start))
            self.check_shows_the_cube(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))

    def test_the_page_lists_the_camera(self):
        page = self.curl(self.address + "/").decode()
        self.assertIn('<a href="stream?topic=%s">Stream</a>' % TOPIC, page)
        self.assertIn('<img src="stream?topic=%s"' % TOPIC, self.curl(
            "%s/stream_viewer?topic=%s" % (self.address, TOPIC)).decode())

    def test_what_is_not_there_is_said(self):
        for query, status, text in (("topic=/nowhere", 404, TOPIC), ("type=h264&topic=" + TOPIC, 501, "video encoder")):
            with self.assertRaises(urllib.error.HTTPError) as caught:
                urllib.request.urlopen("%s/stream?%s" % (self.address, query), timeout=stretched(30))
            self.assertEqual(caught.exception.code, status)
            self.assertIn(text, caught.exception.read().decode())

    def test_a_foreign_page_is_refused(self):
        request = urllib.request.Request(self.address + "/", headers={"Origin": "http://evil.example"})
        with self.assertRaises(urllib.error.HTTPError) as caught:
            urllib.request.urlopen(request, timeout=stretched(30))
        self.assertEqual(caught.exception.code, 403)


if __name__ == "__main__":
    import rostest
    rospy.init_node("web_video_server_rostest")
    rostest.rosrun("web_video_server", "web_video_server", WebVideoServerTest)
