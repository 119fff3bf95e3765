# SPDX-License-Identifier: BSD-3-Clause
"""Camera and range sensor of a hand, by topics and tf: the same on the simulator and on the robot."""
import numpy as np
import rospy
import tf2_ros
from cv_bridge import CvBridge
from sensor_msgs.msg import CameraInfo, Image, Range

from baxter_dataflow import wait_for
from urdf_model.transforms import matrix_from_quaternion, rigid

from .looking import View

BASE = "base"
# Longest wait for messages, and for tf to know a moment [s].
TIMEOUT_S = 30.0
# The sensor measures at 50 Hz, and is published at 100 Hz: so many messages are of 1 s.
READINGS = 100


class HandSenses:
    """What the hand of an arm, "left" or "right", sees and feels.

    Its methods raise OSError with errno ETIMEDOUT after 30 s of silence, and tf2_ros.TransformException for frames that
    tf does not know.
    """

    def __init__(self, limb):
        self._camera, self._sensor = "%s_hand_camera" % limb, "%s_hand_range" % limb
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)

    def look(self):
        """The `View` of the camera's next picture, where it was taken."""
        info, = _next_messages("/cameras/%s/camera_info" % self._camera, CameraInfo)
        image, = _next_messages("/cameras/%s/image" % self._camera, Image)
        picture = CvBridge().imgmsg_to_cv2(image, "rgb8")
        return View(picture, np.reshape(info.K, (3, 3)), self._pose(image.header.frame_id, image.header.stamp))

    def feel(self):
        """(mean height of the range sensor in `base` [m], its next readings [m])."""
        messages = _next_messages("/robot/range/%s/state" % self._sensor, Range, READINGS)
        heights = [self._pose(self._sensor, message.header.stamp)[2, 3] for message in messages]
        return float(np.mean(heights)), [message.range for message in messages]

    def _pose(self, frame, stamp):
        transform = self._buffer.lookup_transform(BASE, frame, stamp, rospy.Duration(TIMEOUT_S)).transform
        turn, place = transform.rotation, transform.translation
        return rigid(matrix_from_quaternion((turn.x, turn.y, turn.z, turn.w)), (place.x, place.y, place.z))


def _next_messages(topic, kind, count=1):
    """The next `count` messages of a topic; a list."""
    messages = []
    subscriber = rospy.Subscriber(topic, kind, messages.append)
    try:
        wait_for(lambda: len(messages) >= count, TIMEOUT_S,
                 timeout_msg="fewer than %d messages came on %s in %.0f s" % (count, topic, TIMEOUT_S))
    finally:
        subscriber.unregister()
    return messages[:count]
