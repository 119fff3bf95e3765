# SPDX-License-Identifier: BSD-3-Clause
"""Markers whose frame cannot be found stay in it, and keep none of the others back."""
from types import SimpleNamespace

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from visualization_msgs.msg import InteractiveMarkerPose, InteractiveMarkerUpdate

from interactive_marker_proxy import node


class Topic:
    def __init__(self, *_, **__):
        self.sent = []

    def publish(self, message):
        self.sent.append(message)


@pytest.fixture
def proxy(monkeypatch):
    """A Proxy into the frame "base", in which "shelf" is 1 m ahead."""
    monkeypatch.setattr(rospy, "Publisher", Topic)
    for name in ("Service", "Subscriber"):
        monkeypatch.setattr(rospy, name, lambda *_, **__: None)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *_: None)
    monkeypatch.setattr(tf2_ros, "TransformListener", lambda _: None)
    core = tf2_ros.BufferCore(rospy.Duration(10))
    monkeypatch.setattr(tf2_ros, "Buffer", lambda: SimpleNamespace(lookup_transform=core.lookup_transform_core))
    made = node.Proxy("markers", "base")
    shelf = TransformStamped(child_frame_id="shelf")
    shelf.header.frame_id = "base"
    shelf.transform.translation.x = shelf.transform.rotation.w = 1.0
    core.set_transform_static(shelf, "test")
    return made


@pytest.mark.parametrize("frame", ["nowhere", "no\0where", ""])
def test_a_marker_in_no_frame_stays_there_and_the_next_one_is_moved(proxy, frame):
    update = InteractiveMarkerUpdate(poses=[InteractiveMarkerPose(name=name) for name in "ab"])
    for pose, name in zip(update.poses, (frame, "shelf"), strict=True):
        pose.header.frame_id, pose.header.stamp, pose.pose.orientation.w = name, rospy.Time(1), 1.0
    proxy._on_update(update)
    sent, = proxy._updates.sent
    assert [one.header.frame_id for one in sent.poses] == [frame, "base"]
    assert [one.pose.position.x for one in sent.poses] == [0.0, 1.0]
