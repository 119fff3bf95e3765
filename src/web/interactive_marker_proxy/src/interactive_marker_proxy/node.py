# SPDX-License-Identifier: BSD-3-Clause
"""The node: `~topic_ns` is where the markers are, `~target_frame` the frame that the page wants."""
from __future__ import annotations

import copy
import sys
from typing import Any

import rospy
import tf2_ros
from geometry_msgs.msg import Point, Quaternion
from visualization_msgs.msg import (
    InteractiveMarkerInit,
    InteractiveMarkerUpdate,
)

from interactive_marker_proxy.mirror import MarkerMirror, moved
from interactive_marker_proxy.srv import GetInit
from rospy_nodes.start import end_on_signals, limit_ports


class Proxy:
    def __init__(self, topic: str, frame: str) -> None:
        self._frame = frame.lstrip("/")
        self._mirror = MarkerMirror()
        self._buffer = tf2_ros.Buffer()
        self._updates = rospy.Publisher(topic + "/tunneled/update", InteractiveMarkerUpdate, queue_size=100)
        self._kept = [
            tf2_ros.TransformListener(self._buffer),
            rospy.Service(topic + "/tunneled/get_init", GetInit, self._get_init),
            rospy.Subscriber(topic + "/update_full", InteractiveMarkerInit, self._mirror.begin, queue_size=100),
            rospy.Subscriber(topic + "/update", InteractiveMarkerUpdate, self._on_update, queue_size=100)]

    def _on_update(self, update: Any) -> None:
        self._mirror.update(copy.deepcopy(update))
        for one in (*update.markers, *update.poses):
            self._to_frame(one)
        self._updates.publish(update)

    def _get_init(self, _request: object) -> list[InteractiveMarkerInit]:
        init = self._mirror.fill(InteractiveMarkerInit())
        for marker in init.markers:
            self._to_frame(marker)
        return [init]

    def _to_frame(self, one: Any) -> None:
        """Express a marker's pose in the page's frame; it stays as it is where tf cannot say, and without a stamp."""
        if one.header.stamp == rospy.Time():
            # The marker moves with its frame: the page follows it in tf, and the server takes the page's poses as being
            # in that frame.
            return
        try:
            found = self._buffer.lookup_transform(self._frame, one.header.frame_id.lstrip("/"), rospy.Time(0)).transform
        # ValueError: a name with a zero in it.
        except (tf2_ros.TransformException, ValueError) as error:
            rospy.logwarn_throttle(10.0, "marker %s stays in frame %r: %s", one.name, one.header.frame_id, error)
            return
        move, turn, place, orientation = found.translation, found.rotation, one.pose.position, one.pose.orientation
        position, quaternion = moved((move.x, move.y, move.z), (turn.x, turn.y, turn.z, turn.w),
                                     (place.x, place.y, place.z),
                                     (orientation.x, orientation.y, orientation.z, orientation.w))
        one.header.frame_id = self._frame
        one.pose.position, one.pose.orientation = Point(*position), Quaternion(*quaternion)


def main() -> None:
    limit_ports()
    end_on_signals()
    rospy.init_node("interactive_marker_proxy", disable_signals=True)
    topic, frame = str(rospy.get_param("~topic_ns", "")), str(rospy.get_param("~target_frame", ""))
    if not topic or not frame:
        rospy.logfatal("~topic_ns and ~target_frame are needed: where the markers are, and the page's frame")
        sys.exit(1)
    proxy = Proxy(topic, frame)
    rospy.spin()
    del proxy
