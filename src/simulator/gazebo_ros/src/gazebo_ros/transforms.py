# SPDX-License-Identifier: BSD-3-Clause
"""Frames from tf, in the loop: without a thread and without waiting."""
from __future__ import annotations

from typing import TYPE_CHECKING

from geometry_msgs.msg import Quaternion, TransformStamped
from rospy import Duration, Time
from tf2_msgs.msg import TFMessage
from tf2_py import BufferCore, TransformException

from bullet_sim import Pose
from sim_time.stamps import stamp
from urdf_model.transforms import matrix_from_quaternion, rigid

if TYPE_CHECKING:
    import numpy as np

    from loop_ros.protocol import Topics

# Transforms that are kept [s], and messages with transforms between two ticks.
TF_CACHE_S, TF_DEPTH = 10, 100


class TransformSource:
    """Transforms from tf, listened to from now on until :meth:`close`."""

    def __init__(self, topics: Topics) -> None:
        self._buffer = BufferCore(Duration(TF_CACHE_S))
        self._topics = {topics.subscription(name, TFMessage, TF_DEPTH): take for name, take in (
            ("/tf", self._buffer.set_transform), ("/tf_static", self._buffer.set_transform_static))}

    def take(self) -> None:
        """Take the transforms that have come since."""
        for topic, take in self._topics.items():
            topic.handle(lambda message, take=take: [take(transform, "tf") for transform in message.transforms])

    def look_up(self, target: str, source: str) -> np.ndarray | None:
        """The newest pose (4, 4) of the frame ``source`` in ``target``, or None where it is not known."""
        try:
            found = self._buffer.lookup_transform_core(target, source, Time(0)).transform
        except (TransformException, ValueError):  # ValueError: a name with a zero in it
            return None
        turn, shift = found.rotation, found.translation
        return rigid(matrix_from_quaternion((turn.x, turn.y, turn.z, turn.w)), (shift.x, shift.y, shift.z))

    def close(self) -> None:
        for topic in self._topics:
            topic.close()


def transform_msg(time_s: float, parent: str, child: str, pose: np.ndarray) -> TransformStamped:
    """The TransformStamped of the frame ``child``, which is at ``pose`` (4, 4) in ``parent``."""
    transform = TransformStamped(child_frame_id=child)
    transform.header.stamp, transform.header.frame_id = stamp(time_s), parent
    translation = transform.transform.translation
    translation.x, translation.y, translation.z = pose[:3, 3].tolist()
    transform.transform.rotation = Quaternion(*quaternion(pose))
    return transform


def quaternion(pose: np.ndarray) -> tuple[float, ...]:
    """x, y, z, w of the rotation of ``pose`` (4, 4), w not below 0."""
    found = Pose.from_matrix(pose).quaternion
    return found if found[3] >= 0.0 else tuple(-value for value in found)
