# SPDX-License-Identifier: BSD-3-Clause
"""The window's pictures as a topic, for browsers and recordings."""
from __future__ import annotations

from typing import TYPE_CHECKING

import rospy
from sensor_msgs.msg import Image

if TYPE_CHECKING:
    from world_window.viewer import Frame


class PictureTopic:
    """``~image``: the newest picture, without what is drawn over it. A late subscriber gets it at once."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~image", Image, queue_size=1, latch=True)

    @property
    def has_listeners(self) -> bool:
        """Whether a program subscribes."""
        return self._publisher.get_num_connections() > 0

    def take(self, frame: Frame) -> None:
        """Publish a :class:`world_window.viewer.Frame`, if it has a new picture."""
        if frame.pixels is None or frame.clock is None:
            return
        height, width = frame.pixels.shape[:2]
        message = Image(height=height, width=width, encoding="rgb8", step=3 * width, data=frame.pixels.tobytes())
        message.header.stamp = rospy.Time.from_sec(frame.clock[0])
        message.header.frame_id = "world"
        self._publisher.publish(message)
