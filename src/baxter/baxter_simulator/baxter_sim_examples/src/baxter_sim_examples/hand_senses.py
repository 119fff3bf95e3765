# SPDX-License-Identifier: BSD-3-Clause
"""Cameras, depth cameras and the range sensors of hands, by topics and tf: the same on the simulator and on the
robot."""
from __future__ import annotations

import numpy as np
import rospy
import tf2_ros
from cv_bridge import CvBridge
from sensor_msgs import point_cloud2
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, Range

from baxter_dataflow import wait_for
from command_line.options import counted
from urdf_model.transforms import matrix_from_quaternion, rigid

from .looking import CameraView

BASE = "base"
# Longest wait for messages, and for tf to know a moment [s].
TIMEOUT_S = 30.0
# The sensor measures at 50 Hz, and is published at 100 Hz: so many messages are of 1 s.
READINGS = 100


class Eyes:
    """Pictures of cameras, and the cameras' poses.

    Its methods raise OSError with errno ETIMEDOUT after 30 s of silence, and tf2_ros.TransformException for frames that
    tf does not know.
    """

    def __init__(self) -> None:
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)

    def view(self, image_topic: str, info_topic: str) -> CameraView:
        """The `CameraView` of a camera's next picture, where it was taken."""
        info, = _next_messages(info_topic, CameraInfo)
        image, = _next_messages(image_topic, Image)
        picture = CvBridge().imgmsg_to_cv2(image, "rgb8")
        return CameraView(picture, np.reshape(info.K, (3, 3)), self.pose(image.header.frame_id, image.header.stamp),
                          tuple(info.D))

    def points(self, topic: str) -> np.ndarray:
        """The points (n, 3) [m], in `base`, of the next cloud of a depth camera."""
        cloud, = _next_messages(topic, PointCloud2)
        found = np.array(list(point_cloud2.read_points(cloud, ("x", "y", "z"), skip_nans=True))).reshape(-1, 3)
        pose = self.pose(cloud.header.frame_id, cloud.header.stamp)
        return found @ pose[:3, :3].T + pose[:3, 3]

    def pose(self, frame: str, stamp: rospy.Time) -> np.ndarray:
        """The pose (4, 4) of a frame in `base` at a time (rospy.Time)."""
        transform = self._buffer.lookup_transform(BASE, frame, stamp, rospy.Duration.from_sec(TIMEOUT_S)).transform
        turn, place = transform.rotation, transform.translation
        return rigid(matrix_from_quaternion((turn.x, turn.y, turn.z, turn.w)), (place.x, place.y, place.z))


class HandSenses:
    """The sensors of the hand of an arm, "left" or "right"; raises as :class:`Eyes`."""

    def __init__(self, limb: str) -> None:
        self._camera, self._sensor = "%s_hand_camera" % limb, "%s_hand_range" % limb
        self._eyes = Eyes()

    def look(self) -> CameraView:
        """The `CameraView` of the camera's next picture, where it was taken."""
        return self._eyes.view("/cameras/%s/image" % self._camera, "/cameras/%s/camera_info" % self._camera)

    def feel(self) -> tuple[float, list[float]]:
        """(mean height of the range sensor in `base` [m], its next readings [m])."""
        messages = _next_messages("/robot/range/%s/state" % self._sensor, Range, READINGS)
        heights = [self._eyes.pose(self._sensor, message.header.stamp)[2, 3] for message in messages]
        return float(np.mean(heights)), [message.range for message in messages]


def _next_messages(topic, kind, count=1):
    """The next `count` messages of a topic; a list."""
    messages = []
    subscriber = rospy.Subscriber(topic, kind, messages.append)
    try:
        wait_for(lambda: len(messages) >= count, TIMEOUT_S,
                 timeout_msg="fewer than %s came on %s in %.0f s" % (counted(count, "message"), topic, TIMEOUT_S))
    finally:
        subscriber.unregister()
    return messages[:count]
