#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Case Western's world through its sensors: a cube of known size and place, cameras, lasers, a reset."""
import errno
import unittest

import numpy as np
import rospy
import tf2_ros
from baxter_core_msgs.msg import CameraControl, CameraSettings
from baxter_core_msgs.srv import CloseCamera, ListCameras, OpenCamera
from cv_bridge import CvBridge
from dynamic_reconfigure.client import Client
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from seen import is_red, matrix_of, picture_of, points_of
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState, LaserScan, PointCloud2
from std_srvs.srv import Empty

from lab_testing.waiting import wait_for_message

SIDES = ("left", "right")
SIDE_M, AT = 0.06, (0.72, 0.15, 0.775)  # on the table; physics world
BASE_Z = 0.93  # of the robot's base in the physics world
CUBE = """<sdf version="1.6"><model name="cube"><static>true</static><link name="l"><pose>0 0 0.03 0 0 0</pose>
<collision name="c"><geometry><box><size>0.06 0.06 0.06</size></box></geometry></collision>
<visual name="v"><geometry><box><size>0.06 0.06 0.06</size></box></geometry>
<material><ambient>0.9 0.02 0.02 1</ambient><diffuse>0.9 0.02 0.02 1</diffuse></material></visual></link></model>
</sdf>"""
ONLOOKER = """<sdf version="1.6"><model name="onlooker"><static>true</static><link name="l">
<pose>%f %f %f %f %f %f</pose>
<sensor type="camera" name="onlooker"><update_rate>20</update_rate><camera><horizontal_fov>0.8</horizontal_fov><image>
<width>320</width><height>240</height></image><clip><near>0.05</near><far>20</far></clip></camera>
<plugin name="p" filename="libgazebo_ros_camera.so"/></sensor></link></model></sdf>"""
# The region of the Kinect's picture where the red frame of the robot's own screen is not.
ROBOT_FREE_ROWS = 380
KINECT = {"/kinect/%s" % name for name in (
    "rgb/image_raw", "rgb/image_raw/compressed", "rgb/camera_info", "depth/image_raw", "depth/camera_info",
    "depth/points", *(place + "parameter_" + what for place in ("", "rgb/image_raw/compressed/")
                      for what in ("descriptions", "updates")))}


def service(name, kind):
    rospy.wait_for_service(name, 60.0)
    return rospy.ServiceProxy(name, kind)


def red_rows(image):
    return is_red(picture_of(image))[:ROBOT_FREE_ROWS]


class CwruWorldTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.buffer = tf2_ros.Buffer(rospy.Duration(100.0))
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        wait_for_message("/robot/joint_states", JointState)

    def put_cube(self, at=AT):
        place = Pose(Point(*at), Quaternion(0, 0, 0, 1))
        answer = service("/gazebo/spawn_sdf_model", SpawnModel)("cube", CUBE, "", place, "world")
        self.assertTrue(answer.success, answer.status_message)
        self.addCleanup(service("/gazebo/delete_model", DeleteModel), "cube")

    def base_in(self, frame):
        return matrix_of(self.buffer.lookup_transform(frame, "base", rospy.Time(), rospy.Duration(30.0)))

    def corners(self, at=AT):
        """(8, 4) of the cube, in base."""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]) * SIDE_M / 2.0
        return np.hstack([signs + at - [0.0, 0.0, BASE_Z], np.ones((8, 1))])

    def assert_seen_where_it_projects(self, red, info, frame, at=AT):
        """red: (height, width), mask of the cube in the picture of the camera of sensor_msgs/CameraInfo `info`."""
        optical = (self.corners(at) @ self.base_in(frame).T)[:, :3]
        pixels = optical @ np.array(info.K).reshape(3, 3).T
        pixels = pixels[:, :2] / pixels[:, 2:]
        rows, columns = np.nonzero(red)
        seen = [columns.min(), columns.max(), rows.min(), rows.max()]
        expected = [pixels[:, 0].min(), pixels[:, 0].max(), pixels[:, 1].min(), pixels[:, 1].max()]
        self.assertLess(np.abs(np.array(seen) - expected).max(), 2.0, "%s is not %s" % (seen, expected))

    def test_a_cube_is_where_it_projects_and_where_it_is(self):
        self.put_cube()
        image = wait_for_message("/kinect/rgb/image_raw", Image, lambda message: red_rows(message).sum() > 300)
        self.assertEqual((image.width, image.height, image.encoding, image.header.frame_id),
                         (640, 480, "rgb8", "kinect_pc_frame"))
        info = wait_for_message("/kinect/rgb/camera_info", CameraInfo)
        self.assert_seen_where_it_projects(red_rows(image), info, "kinect_pc_frame")

        cloud = wait_for_message("/kinect/depth/points", PointCloud2)
        xyz, colours = points_of(cloud)
        self.assertEqual(cloud.header.frame_id, "kinect_pc_frame")
        red = is_red(colours)[:ROBOT_FREE_ROWS] & np.isfinite(xyz[:ROBOT_FREE_ROWS, :, 2])
        points = np.hstack([xyz[:ROBOT_FREE_ROWS][red], np.ones((red.sum(), 1))])
        points = points @ np.linalg.inv(self.base_in("kinect_pc_frame")).T
        low, high = self.corners()[:, :3].min(axis=0), self.corners()[:, :3].max(axis=0)
        self.assertTrue((points[:, :3] > low - 0.005).all() and (points[:, :3] < high + 0.005).all(),
                        "points from %s to %s, the cube from %s to %s" % (
                            points.min(axis=0), points.max(axis=0), low, high))
        self.assertLess(abs(np.percentile(points[:, 2], 95) - high[2]), 0.005)
        self.assertLess(abs(points[:, 1].max() - high[1]), 0.005)

        # Depth is the same third coordinate; cv_bridge reads both.
        depth_message = wait_for_message("/kinect/depth/image_raw", Image)
        depth = CvBridge().imgmsg_to_cv2(depth_message, "32FC1")
        both = np.isfinite(depth) & np.isfinite(xyz[:, :, 2])
        self.assertGreater(both.mean(), 0.5)
        self.assertLess(np.median(np.abs(depth[both] - xyz[:, :, 2][both])), 1e-4)
        self.assertEqual(CvBridge().imgmsg_to_cv2(image, "bgr8").shape, (480, 640, 3))
        compressed = wait_for_message("/kinect/rgb/image_raw/compressed", CompressedImage)
        self.assertEqual(CvBridge().compressed_imgmsg_to_cv2(compressed).shape, (480, 640, 3))

    def test_the_robots_cameras_see_a_cube_where_it_projects(self):
        for camera in ("head_camera", "left_hand_camera", "right_hand_camera"):
            # Ahead, a little to the right and up in the camera's own optical frame.
            at = (np.linalg.inv(self.base_in(camera)) @ [0.07, -0.05, 0.6, 1.0])[:3] + [0.0, 0.0, BASE_Z]
            self.put_cube(at)
            topic = "/cameras/%s/" % camera
            image = wait_for_message(topic + "image", Image, lambda message: is_red(picture_of(message)).sum() > 1000)
            info = wait_for_message(topic + "camera_info", CameraInfo)
            self.assertEqual(image.header.frame_id, camera)
            self.assert_seen_where_it_projects(is_red(picture_of(image)), info, camera, at)
            self.doCleanups()

    def test_the_can_stands_on_the_table(self):
        cloud = wait_for_message("/kinect/depth/points", PointCloud2)
        xyz, _ = points_of(cloud)
        points = xyz[np.isfinite(xyz[:, :, 2])]
        points = np.hstack([points, np.ones((len(points), 1))]) @ np.linalg.inv(self.base_in("kinect_pc_frame")).T
        near = points[np.hypot(points[:, 0] - 0.69112, points[:, 1]) < 0.06]
        top = near[near[:, 2] > 0.775 + 0.15 - BASE_Z]
        self.assertGreater(len(top), 100)
        self.assertLess(abs(np.median(top[:, 2]) - (0.775 + 0.168 - BASE_Z)), 0.005)
        table = near[near[:, 2] < 0.775 + 0.02 - BASE_Z]
        self.assertGreater(len(table), 100)
        self.assertLess(abs(np.median(table[:, 2]) - (0.775 - BASE_Z)), 0.005)

    def test_what_is_deleted_is_no_longer_seen_and_a_reset_blinds_nobody(self):
        self.put_cube()
        wait_for_message("/kinect/rgb/image_raw", Image, lambda message: red_rows(message).sum() > 300)
        service("/gazebo/delete_model", DeleteModel)("cube")
        wait_for_message("/kinect/rgb/image_raw", Image, lambda message: not red_rows(message).any())
        before = rospy.get_time()
        service("/gazebo/reset_simulation", Empty)()
        # One from just before the reset may come late on a busy machine.
        image = wait_for_message("/kinect/rgb/image_raw", Image,
                                 lambda message: message.header.stamp.to_sec() < 0.5 * before)
        later = wait_for_message("/kinect/rgb/image_raw", Image,
                         lambda message: message.header.stamp.to_sec() > image.header.stamp.to_sec() + 0.5)
        self.assertGreater(picture_of(later).std(), 10.0)

    def test_settings_that_can_be_changed_are_felt(self):
        topic = "/kinect/rgb/image_raw/compressed"
        size = len(wait_for_message(topic, CompressedImage).data)
        quality, rate = (Client(name, timeout=60.0) for name in (topic, "/kinect"))
        self.assertEqual((quality.get_configuration()["jpeg_quality"], rate.get_configuration()["imager_rate"]),
                         (80, 10.0))
        self.assertEqual(quality.update_configuration({"jpeg_quality": 5})["jpeg_quality"], 5)
        wait_for_message(topic, CompressedImage, lambda message: len(message.data) < 0.5 * size)
        rate.update_configuration({"imager_rate": 2.0})
        stamps = []

        def are_half_a_second_apart(message):
            stamps.append(message.header.stamp.to_sec())
            return len(stamps) > 1 and abs(stamps[-1] - stamps[-2] - 0.5) < 0.1

        wait_for_message(topic, CompressedImage, are_half_a_second_apart)
        quality.update_configuration({"jpeg_quality": 80})
        rate.update_configuration({"imager_rate": 10.0})

    def test_cameras_open_and_close_with_what_the_robot_has(self):
        opening, closing = service("/cameras/open", OpenCamera), service("/cameras/close", CloseCamera)
        # Restored also after a failure, because other tests use them.
        self.addCleanup(service("/cameras/reset", Empty))
        cameras = service("/cameras/list", ListCameras)().cameras
        self.assertEqual(set(cameras), {"head_camera", "left_hand_camera", "right_hand_camera"})
        for camera in cameras:
            topic = "/cameras/%s/image" % camera
            first = wait_for_message(topic, Image)
            self.assertEqual((first.width, first.height, first.header.frame_id), (800, 800, camera))
            controls = [CameraControl(107, 1), CameraControl(108, 1)]
            self.assertEqual(opening(camera, CameraSettings(320, 200, 20.0, controls)).err, 0)
            small = wait_for_message(topic, Image, lambda message: message.width == 320)
            self.assertEqual(small.height, 200)
            info = wait_for_message("/cameras/%s/camera_info_std" % camera, CameraInfo,
                                    lambda message: message.width == 320)
            self.assertLess(info.K[0], 0.0)  # turned by flip and mirror
            self.assertEqual(opening(camera, CameraSettings(123, 456, 20.0, [])).err, errno.EINVAL)
            self.assertEqual(closing(camera).err, 0)
            self.assertNotIn(topic, {name for name, _ in rospy.get_published_topics()})
            # For a closed camera, clients accept only this error code.
            self.assertEqual(closing(camera).err, errno.EINVAL)
        self.assertEqual(opening("nose_camera", CameraSettings(320, 200, 20.0, [])).err, errno.ENODEV)
        service("/cameras/reset", Empty)()
        for camera in cameras:
            self.assertEqual(wait_for_message("/cameras/%s/image" % camera, Image).width, 800)

    def test_the_screen_shows_its_picture_to_a_camera_that_looks_at_the_robot(self):
        # 0.5 m in front of the glass, looking straight at it; its pose is from tf, and base is upright in the world.
        self.buffer.lookup_transform("base", "display", rospy.Time(), rospy.Duration(30.0))
        glass = np.linalg.inv(self.base_in("display"))
        tilt = np.radians(15.0)
        out = glass[:3, :3] @ [0.0, -np.sin(tilt), np.cos(tilt)]
        x, y, z = glass[:3, 3] + 0.5 * out + [0.0, 0.0, BASE_Z]
        pitch, yaw = np.arcsin(out[2]), np.arctan2(-out[1], -out[0])
        onlooker = ONLOOKER % (x, y, z, 0.0, pitch, yaw)
        answer = service("/gazebo/spawn_sdf_model", SpawnModel)("onlooker", onlooker, "", Pose(), "world")
        self.assertTrue(answer.success, answer.status_message)
        self.addCleanup(service("/gazebo/delete_model", DeleteModel), "onlooker")

        pixels = np.zeros((600, 1024, 3), dtype=np.uint8)
        pixels[:300, :512], pixels[300:, 512:] = (0, 255, 0), (255, 0, 0)
        show = rospy.Publisher("/robot/xdisplay", Image, queue_size=1, latch=True)
        show.publish(CvBridge().cv2_to_imgmsg(np.ascontiguousarray(pixels[:, :, ::-1]), "bgr8"))

        def is_shown(message):
            found = picture_of(message).astype(int)
            upper_left, lower_right = found[100:115, 130:145], found[125:140, 175:190]
            dark = found[125:140, 130:145]
            return (upper_left == (0, 255, 0)).all() and (lower_right == (255, 0, 0)).all() and (dark == 0).all()

        wait_for_message("/onlooker/image_raw", Image, is_shown)
        show.publish(CvBridge().cv2_to_imgmsg(np.zeros((600, 1024, 3), dtype=np.uint8), "bgr8"))
        wait_for_message("/onlooker/image_raw", Image, lambda message: not picture_of(message)[100:140, 130:190].any())

    def test_lasers_and_the_names_of_topics(self):
        for side in ("left", "right"):
            scan = wait_for_message("/sim/laserscan/%s_hand_range/state" % side, LaserScan)
            self.assertEqual((scan.header.frame_id, len(scan.ranges)), ("%s_hand_range" % side, 1))
            self.assertAlmostEqual(scan.range_max, 0.4, 6)
            self.assertTrue(np.isinf(scan.ranges[0]), "nothing is before the hands of outstretched arms")
        published, subscribed, _ = rospy.get_master().getSystemState()[2]
        names = {name for name, _ in published + subscribed}
        self.assertEqual({name for name in names if name.startswith("/kinect/")}, KINECT)
        # As on the page about the sheets; what tests and closed cameras add and take is a few.
        for group, count in (("", 310), ("/cameras", 24), ("/robot", 237)):
            found = len([name for name in names if name.startswith(group + "/")])
            self.assertLess(abs(found - count), 10, "%d topics under '%s', the page has %d" % (found, group, count))

    def test_the_robot_stands_as_the_notes_have_it(self):
        states = wait_for_message("/robot/joint_states", JointState)
        joints = ("e0", "e1", "s0", "s1", "w0", "w1", "w2")
        self.assertEqual(states.name, ["head_pan", *("%s_%s" % (side, joint) for side in SIDES for joint in joints)])
        self.assertEqual(states.header.frame_id, "")
        self.assertLess(max(map(abs, states.position)), 0.02)
        place = matrix_of(self.buffer.lookup_transform("head", "kinect_link", rospy.Time(), rospy.Duration(30.0)))
        self.assertLess(np.abs(place[:3, 3] - [0.14, 0.0, 0.264]).max(), 1e-6)
        same = matrix_of(self.buffer.lookup_transform("kinect_link", "camera_link", rospy.Time(), rospy.Duration(30.0)))
        self.assertLess(np.abs(same - np.eye(4)).max(), 1e-9)


if __name__ == "__main__":
    import rostest
    rospy.init_node("cwru_world_rostest")
    rostest.rosrun("cwru_baxter_sim", "cwru_world", CwruWorldTest)
