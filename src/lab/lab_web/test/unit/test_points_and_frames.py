# SPDX-License-Identifier: BSD-3-Clause
"""Points and frames for pages: who gets which, and what is subscribed to."""
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
import tf2_ros

from lab_web.clouds import MARK
from lab_web.lab import RobotError
from lab_web.overlay import CLOUD_S, PageOverlay
from lab_web.overlay_topics import OverlayTopics


def cloud(frame="camera", count=2):
    fields = [SimpleNamespace(name=name, offset=4 * number, datatype=7) for number, name in enumerate("xyz")]
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), width=count, height=1, fields=fields, point_step=12,
                           row_step=12 * count, is_bigendian=False, data=np.ones(3 * count, "<f4").tobytes())


class Graph:
    def __init__(self):
        self.taken, self.closed = {}, []
        self.lifted = np.eye(4)
        self.lifted[2, 3] = 0.9

    def clouds(self):
        return ["/kinect/points", "/other/points"]

    def subscribe(self, topic, take):
        self.taken[topic] = take
        return SimpleNamespace(close=lambda: self.closed.append(topic))

    def frames(self):
        return ["base", "camera", "lost"]

    def pose(self, frame):
        return {"base": np.eye(4), "camera": 2.0 * np.eye(4) - np.diag([0, 0, 0, 1.0])}.get(frame)

    def base(self):
        return self.lifted


@pytest.fixture
def scene():
    made = SimpleNamespace(graph=Graph(), shown=[], answers=[], told=[], now=0.0)
    made.overlay = PageOverlay(made.graph, lambda *what: made.shown.append(what),
                               lambda *what: made.answers.append(what),
                               lambda *what: made.told.append(what), lambda: made.now)
    return made


def test_points_go_to_the_pages_that_want_them_five_times_a_second(scene):
    for client in (1, 2):
        scene.overlay.watch(client, {"points": "/kinect/points"})
    scene.overlay.watch(3, {"points": ""})
    scene.overlay.settle()
    assert list(scene.graph.taken) == ["/kinect/points"]
    for _ in range(3):
        scene.graph.taken["/kinect/points"](cloud())
    assert [client for client, _ in scene.shown] == [1, 2]
    data = scene.shown[0][1]
    assert np.frombuffer(data[:8], "<u4").tolist() == [MARK, 2]
    # The camera's pose in base, and base's in the scene.
    assert np.frombuffer(data[8:56], "<f4").reshape(3, 4)[2].tolist() == [0, 0, 2, pytest.approx(0.9)]
    scene.now += CLOUD_S
    scene.graph.taken["/kinect/points"](cloud())
    assert len(scene.shown) == 4


def test_a_topic_that_nobody_wants_any_more_is_left(scene):
    for client in (1, 2):
        scene.overlay.watch(client, {"points": "/kinect/points"})
    scene.overlay.settle()
    scene.overlay.watch(1, {"points": "/other/points"})
    scene.overlay.settle()
    assert scene.graph.closed == []
    scene.overlay.forget(2)
    scene.overlay.settle()
    assert scene.graph.closed == ["/kinect/points"]


def test_what_is_wrong_is_told_once(scene):
    scene.overlay.watch(1, {"points": "/kinect/points"})
    scene.overlay.watch(2, {"points": "/nowhere", "frames": True})
    scene.overlay.settle()
    assert scene.told == [(2, "refused", "'/nowhere' is no topic with points; there are /kinect/points, /other/points")]
    for _ in range(3):
        scene.now += CLOUD_S
        scene.graph.taken["/kinect/points"](cloud("attic"))
    scene.overlay.settle()
    assert scene.told[1:] == [(1, "refused", "/kinect/points: tf does not know its frame 'attic'")]
    with pytest.raises(RobotError, match="must be"):
        scene.overlay.watch(1, {"points": 3})


def test_frames_that_tf_knows_go_to_the_pages_that_want_them(scene):
    scene.overlay.watch(1, {"frames": True})
    scene.overlay.watch(2, {"frames": False})
    scene.overlay.send_frames()
    (client, operation), = scene.answers
    assert client == 1 and [name for name, _ in operation["frames"]] == ["base", "camera"]
    assert operation["frames"][0][1] == [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.9]
    scene.graph.lifted = None
    scene.overlay.send_frames()
    assert len(scene.answers) == 1


@pytest.mark.parametrize("frame", ["attic", "at\0tic", ""])
def test_a_frame_that_is_none_has_no_pose(monkeypatch, frame):
    """tf2's library raises an error of its own for a name with a zero."""
    topics, core = OverlayTopics(lambda: None), tf2_ros.BufferCore(rospy.Duration(10))
    monkeypatch.setattr(topics, "_tf", lambda: SimpleNamespace(lookup_transform=core.lookup_transform_core))
    assert topics.pose(frame) is None
