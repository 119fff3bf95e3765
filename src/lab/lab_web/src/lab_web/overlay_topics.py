# SPDX-License-Identifier: BSD-3-Clause
"""The graph of :class:`lab_web.overlay.PageOverlay`, in rospy."""
from __future__ import annotations

import re
import time
from typing import TYPE_CHECKING

import rosgraph
import rospy
import tf2_ros
from sensor_msgs.msg import PointCloud2

from baxter_model import BASE_FRAME
from urdf_model.transforms import matrix_from_quaternion, rigid

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

_CLOUD = "sensor_msgs/PointCloud2"
# The names in tf are asked for that often [s]; the listener ends that long after nobody has asked for a pose [s].
_NAMES_S, _IDLE_S = 2.0, 5.0


class OverlayTopics:
    """Listens to tf while somebody asks. ``base()``: see :mod:`lab_web.overlay`."""

    def __init__(self, base: Callable[[], np.ndarray | None]) -> None:
        self.base = base
        self._buffer = self._listener = None
        self._names, self._names_until_s, self._asked_s = [], 0.0, 0.0

    def clouds(self) -> list[str]:
        """The topics with points; waits for the master."""
        try:
            return sorted(name for name, kind in rospy.get_published_topics() if kind == _CLOUD)
        except (rosgraph.MasterException, rospy.ROSException, OSError):
            return []

    def subscribe(self, topic: str, take: Callable[[PointCloud2], object]) -> _Subscription:
        """An object with ``close()``."""
        return _Subscription(rospy.Subscriber(topic, PointCloud2, take, queue_size=1, buff_size=1 << 24))

    def frames(self) -> list[str]:
        """Names in tf."""
        now = time.monotonic()
        if now >= self._names_until_s:
            self._names_until_s = now + _NAMES_S
            # An entry for each frame begins with its name and a colon; what follows is indented.
            self._names = re.findall(r"^(\S+): *$", self._tf().all_frames_as_yaml(), re.MULTILINE)
        return self._names

    def pose(self, frame: str) -> np.ndarray | None:
        """A frame in the robot's base frame (4 x 4), or None where tf does not know it."""
        try:
            found = self._tf().lookup_transform(BASE_FRAME, frame.lstrip("/"), rospy.Time()).transform
        # ValueError: a name with a zero in it.
        except (tf2_ros.TransformException, ValueError):  # pyright: ignore[reportAttributeAccessIssue]  (compiled)
            return None
        turn, move = found.rotation, found.translation
        return rigid(matrix_from_quaternion((turn.x, turn.y, turn.z, turn.w)), (move.x, move.y, move.z))

    def look_after(self) -> None:
        """End the listener where nobody has asked for a while."""
        if self._listener is not None and time.monotonic() > self._asked_s + _IDLE_S:
            listener, self._listener, self._buffer = self._listener, None, None
            listener.unregister()

    def _tf(self) -> tf2_ros.Buffer:
        self._asked_s = time.monotonic()
        buffer = self._buffer
        if buffer is None:
            buffer = self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(buffer)
        return buffer


class _Subscription:
    def __init__(self, subscriber: rospy.Subscriber) -> None:
        self._subscriber = subscriber

    def close(self) -> None:
        self._subscriber.unregister()
