#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The published ros3d, unmodified, in Debian's Chromium: what its clients show is what is on the graph, and an
interactive marker is dragged.
"""
import http.server
import json
import threading
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from urllib.parse import quote

import numpy as np
import rospkg
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from interactive_markers.interactive_marker_server import InteractiveMarkerServer
from nav_msgs.msg import OccupancyGrid
from octomap_msgs.msg import Octomap
from sensor_msgs.msg import Image, JointState, LaserScan, PointField
from sensor_msgs.point_cloud2 import create_cloud
from visualization_msgs.msg import (
    InteractiveMarker,
    InteractiveMarkerControl,
    InteractiveMarkerFeedback,
    Marker,
    MarkerArray,
)

from lab_testing import web_clients
from lab_testing.browser import Browser, why_not
from lab_testing.skipping import skip
from lab_testing.waiting import wait_until
from lab_testing.web_robot import address_of

HERE = Path(__file__).parent
PACKAGES = ("baxter_description", "rethink_ee_description")
SIZE = 320, 240
SHELF = (0.25, 0.0, 0.5)
PLACE_TOLERANCE_M = 0.005
BENT_RAD = 0.6
CONTROL_IN_SHELF = (0.25, 0.5, 0.5)
# Levels of an octree, its cell on the positive side of the middle of all axes, and how its format says that.
LEVELS, MIDDLE, OCCUPIED, FREE, INNER, LAST_CHILD = 16, 1 << 15, 0b10, 0b01, 0b11, 7
# A picture of depths: these at the upper left, as a share of the farthest one; below them a mask; then colours.
DEPTH, HALF = 0.5, 64
DRAG_M = 0.4
DRAG_TOLERANCE_M = 0.05


def plus(*places):
    return list(np.sum(places, axis=0))


def coloured(kind, frame, position, colour, number=0):
    """A marker with a side of 0.3 m."""
    marker = Marker(type=kind, ns="lab", id=number, action=Marker.ADD)
    marker.header.frame_id = frame
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = position
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = 0.3
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = *colour, 1.0
    return marker


def octomap():
    """An occupied cell at the middle, and a free one beside it along x."""
    nodes = [INNER << 2 * LAST_CHILD, *[INNER] * (LEVELS - 2), OCCUPIED | FREE << 2]
    data = np.array(nodes, "<u2").view(np.int8).tolist()
    return Octomap(binary=True, id="OcTree", resolution=0.05, data=data)


def depths():
    """A red wall, encoded as depthcloud_encoder does."""
    pixels = np.zeros((2 * HALF, 2 * HALF, 3), np.uint8)
    pixels[:HALF, :HALF] = round(255 * DEPTH)
    pixels[HALF:, HALF:, 0] = 255
    return Image(height=2 * HALF, width=2 * HALF, encoding="rgb8", step=6 * HALF, data=pixels.tobytes())


class Graph:
    """The topics and frames that the page shows."""

    def __init__(self):
        self.buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self.buffer)
        self._static = tf2_ros.StaticTransformBroadcaster()
        shelf = TransformStamped(child_frame_id="shelf")
        shelf.header.frame_id, shelf.transform.rotation.w = "base", 1.0
        shelf.transform.translation.x, shelf.transform.translation.y, shelf.transform.translation.z = SHELF
        self._static.sendTransform(shelf)
        robot = ElementTree.fromstring(rospy.get_param("/robot_description"))
        self._joints = [joint.get("name") for joint in robot.findall("joint") if joint.get("type") != "fixed"]
        self.angle = 0.0
        self._states = rospy.Publisher("/joint_states", JointState, queue_size=1)
        self._depths = rospy.Publisher("/lab/depths", Image, queue_size=1)
        self._timers = [rospy.Timer(rospy.Duration(0.05), self._say_joints),
                        rospy.Timer(rospy.Duration(0.2), lambda _event: self._depths.publish(depths()))]
        self._latched = []
        self._publish()
        self.feedback = []
        self.controls = InteractiveMarkerServer("/lab/controls")
        self.controls.insert(self._control(), self.feedback.append)
        self.controls.applyChanges()

    def latch(self, topic, message):
        publisher = rospy.Publisher(topic, type(message), latch=True, queue_size=1)
        publisher.publish(message)
        self._latched.append(publisher)
        return publisher

    def place(self, frame, position):
        """A position of a frame in base [m]."""
        found = self.buffer.lookup_transform("base", frame, rospy.Time(0)).transform
        x, y, z, w = (getattr(found.rotation, name) for name in "xyzw")
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        return turn @ position + [getattr(found.translation, name) for name in "xyz"]

    def _say_joints(self, _event):
        message = JointState(name=self._joints, position=[self.angle] * len(self._joints))
        message.header.stamp = rospy.Time.now()
        self._states.publish(message)

    def _publish(self):
        self.marker = self.latch("/lab/marker", coloured(Marker.CUBE, "shelf", (0.75, -0.5, 0.5), (1.0, 0.0, 0.0)))
        self.array = self.latch("/lab/marker_array", MarkerArray([
            coloured(Marker.SPHERE, "shelf", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), number) for number in range(2)]))
        fields = [PointField(name, 4 * index, PointField.FLOAT32, 1) for index, name in enumerate("xyz")]
        header = Marker().header
        header.frame_id = "shelf"
        self.latch("/lab/points", create_cloud(header, [*fields, PointField("rgb", 12, PointField.UINT32, 1)], [
            (0.5, 0.25, 0.125, 0xff0000), (1.5, 1.25, 1.125, 0x0000ff)]))
        scan = LaserScan(angle_min=0.0, angle_increment=np.pi / 2, range_min=0.1, range_max=5.0, ranges=[1.0, 2.0])
        scan.header.frame_id = "shelf"
        self.latch("/lab/scan", scan)
        grid = OccupancyGrid(data=[0, 100, -1, 0, 50, 100])
        grid.header.frame_id = "shelf"
        grid.info.resolution, grid.info.width, grid.info.height = 0.5, 3, 2
        grid.info.origin.orientation.w = 1.0
        self.latch("/lab/map", grid)
        self.latch("/lab/octomap", octomap())

    def _control(self):
        marker = InteractiveMarker(name="handle", scale=0.3)
        marker.header.frame_id = "shelf"
        marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = CONTROL_IN_SHELF
        marker.pose.orientation.w = 1.0
        # Along y: the x axis turned a quarter about z.
        control = InteractiveMarkerControl(name="move_y", interaction_mode=InteractiveMarkerControl.MOVE_AXIS,
                                           always_visible=True)
        control.orientation.z = control.orientation.w = np.sqrt(0.5)
        control.markers.append(coloured(Marker.SPHERE, "", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
        marker.controls.append(control)
        return marker


def page_server(folder):
    """A server of the page, of npm's packages in ``folder`` and of the robot's meshes, on a free port."""
    ros = rospkg.RosPack()
    meshes = {"/packages/%s/" % name: Path(ros.get_path(name)) for name in PACKAGES}

    class Handler(http.server.SimpleHTTPRequestHandler):
        def translate_path(self, path):
            path = path.partition("?")[0]
            if path == "/":
                return str(HERE / "ros3d_page.html")
            for begin, package in meshes.items():
                if path.startswith(begin):
                    return str(package / path.removeprefix(begin))
            return str(folder / "node_modules" / path.lstrip("/"))

        def log_message(self, *_words):
            pass

    return http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)


class Ros3dTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.reason = why_not()
        try:
            folder = web_clients.of_npm()
        except web_clients.NotThere as error:
            cls.reason = cls.reason or str(error)
        if cls.reason:
            return
        cls.graph = Graph()
        cls.server = page_server(folder)
        threading.Thread(target=cls.server.serve_forever, daemon=True).start()
        cls.address = "http://127.0.0.1:%d/?url=%s" % (
            cls.server.server_port, quote(address_of("rosbridge_websocket") + "?token=drive"))
        cls.browser = Browser(*SIZE)

    @classmethod
    def tearDownClass(cls):
        if not cls.reason:
            cls.browser.close()
            cls.server.shutdown()
            cls.server.server_close()

    def setUp(self):
        if self.reason:
            skip(self, self.reason)
        self.open()

    def tearDown(self):
        if not self.reason:
            self.assertEqual(self.browser.errors, [])

    def open(self, query=""):
        """Load the page again."""
        self.browser.call("Page.navigate", url="about:blank")
        self.browser.open(self.address + query)

    def check_near(self, found, expected, tolerance=PLACE_TOLERANCE_M):
        np.testing.assert_allclose(found, expected, atol=tolerance)

    def pixel(self, place):
        return self.browser.evaluate("pixel(...%s)" % json.dumps([float(value) for value in place]))

    def colour_at(self, place):
        """The colour that the window shows there (red, green, blue), as soon as it is no grey."""
        column, row = (round(value) for value in self.pixel(place))

        def found():
            colour = self.browser.picture()[row, column].astype(int)
            return colour.tolist() if np.ptp(colour) > 60 else None
        return wait_until(found, "a colour at %s" % (place,))

    def robot_off(self):
        """Why the page's robot is not yet the one of tf, or ""."""
        parts = self.browser.evaluate("robot()")
        if len(parts) < 20:
            return "%d parts" % len(parts)
        for part in parts:
            if not (part["visible"] and part["meshes"]):
                return "%s is not there" % part["frame"]
            expected = self.graph.place(part["frame"].lstrip("/"), part["inFrame"])
            if np.abs(expected - part["inPage"]).max() > PLACE_TOLERANCE_M:
                return "%s is at %s, not at %s" % (part["frame"], part["inPage"], expected)
        return ""

    def test_the_robot_has_its_meshes_and_follows_tf(self):
        self.open("&robot")
        wait_until(lambda: not self.robot_off(), self.robot_off)
        before = self.graph.place("left_hand", np.zeros(3))
        self.graph.angle = BENT_RAD
        wait_until(lambda: np.abs(self.graph.place("left_hand", np.zeros(3)) - before).max() > 0.1, "bent joints")
        wait_until(lambda: not self.robot_off(), self.robot_off)

    def test_markers(self):
        wait_until(lambda: self.browser.evaluate("placed(shown.marker).lab0"), "the marker")
        place = plus(SHELF, (0.75, -0.5, 0.5))
        self.check_near(self.browser.evaluate("placed(shown.marker).lab0"), place)
        red, green, blue = self.colour_at(place)
        self.assertGreater(red, 2 * max(green, blue))
        wait_until(lambda: sorted(self.browser.evaluate("placed(shown.array)")) == ["lab0", "lab1"], "the array")
        self.check_near(self.browser.evaluate("placed(shown.array).lab1"), plus(SHELF, (0.0, 0.0, 1.0)))
        gone = coloured(Marker.SPHERE, "shelf", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 1)
        gone.action = Marker.DELETE
        self.graph.array.publish([gone])
        wait_until(lambda: list(self.browser.evaluate("placed(shown.array)")) == ["lab0"], "the end of a marker")

    def test_points(self):
        found = self.browser.wait("cloud(shown.points.points, 2)")
        self.assertEqual(found["drawn"], 2)
        self.assertEqual(found["position"], [0.5, 0.25, 0.125, 1.5, 1.25, 1.125])
        self.assertEqual(found["color"], [1, 0, 0, 0, 0, 1])
        self.check_near(found["origin"], SHELF)

    def test_a_laser_scan(self):
        found = self.browser.wait("cloud(shown.scan.points, 2)")
        self.check_near(found["position"], [1.0, 0.0, 0.0, 0.0, 2.0, 0.0])
        self.check_near(found["origin"], SHELF)

    def test_a_map(self):
        found = self.browser.wait("map()")
        self.check_near(found["middle"], (0.75, 0.5, 0.0))
        self.assertEqual(found["scale"], 0.5)
        self.check_near(found["origin"], SHELF)
        # The upper row first. What is unknown, -1, wraps around in ros3d's picture of bytes.
        self.assertEqual(found["red"], [0, 50, 100, 0, 100, 255])

    def test_an_octree(self):
        keys = [MIDDLE] * 3, [MIDDLE + 1, MIDDLE, MIDDLE], [MIDDLE - 1] * 3
        found = self.browser.wait("cells(%s, %s, %s)" % keys)
        self.assertEqual(found, [1, -1, "unknown"])

    def test_a_depth_cloud_of_a_video_stream(self):
        address = address_of("web_video_server").replace("ws", "http") + "stream?topic=/lab/depths"
        self.open("&video=" + quote(address))
        self.browser.wait("Boolean(shown.depths?.mesh)")
        red, green, blue = self.colour_at(plus(SHELF, (0.0, 0.0, DEPTH)))
        self.assertGreater(red, 2 * max(green, blue))

    def test_a_frame(self):
        def off():
            found = self.browser.evaluate("shown.axes.sn.visible && place(shown.axes.sn.position)")
            return not found or np.abs(self.graph.place("left_hand", np.zeros(3)) - found).max() > PLACE_TOLERANCE_M
        wait_until(lambda: not off(), "the cross of left_hand")

    def test_an_interactive_marker_is_dragged(self):
        begin = plus(SHELF, CONTROL_IN_SHELF)
        wait_until(lambda: np.allclose(self.browser.evaluate("control('handle')") or np.inf, begin, atol=1e-3),
                   lambda: "the marker at %s, not at %s" % (begin, self.browser.evaluate("control('handle')")))
        self.colour_at(begin)
        end = plus(begin, (0.0, DRAG_M, 0.0))
        self.browser.drag(self.pixel(begin), self.pixel(end))
        kinds = (InteractiveMarkerFeedback.MOUSE_DOWN, InteractiveMarkerFeedback.POSE_UPDATE,
                 InteractiveMarkerFeedback.MOUSE_UP)
        wait_until(lambda: {one.event_type for one in self.graph.feedback}.issuperset(kinds), "the page's feedback")
        self.assertEqual({(one.marker_name, one.control_name) for one in self.graph.feedback}, {("handle", "move_y")})
        marker = self.graph.controls.get("handle")
        self.assertEqual(marker.header.frame_id, "shelf")
        place = marker.pose.position
        self.check_near((place.x, place.y, place.z), plus(CONTROL_IN_SHELF, (0.0, DRAG_M, 0.0)), DRAG_TOLERANCE_M)
        self.check_near(self.browser.evaluate("control('handle')"), end, DRAG_TOLERANCE_M)

        # What a program does with the marker is seen in the page.
        marker.pose.position.y = 0.0
        self.graph.controls.setPose("handle", marker.pose)
        self.graph.controls.applyChanges()
        wait_until(lambda: abs(self.browser.evaluate("control('handle')")[1]) < 1e-3, "the marker's new place")


if __name__ == "__main__":
    import rostest
    rospy.init_node("ros3d_test")
    rostest.rosrun("rosbridge_server", "ros3d", Ros3dTest)
