# SPDX-License-Identifier: BSD-3-Clause
"""Messages and frames of a hand become a View and a height."""
import numpy as np
import pytest
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rospy import Time
from sensor_msgs.msg import CameraInfo, Image, Range
from std_msgs.msg import Header

from baxter_sim_examples import hand_senses

AT = Time(12, 500000000)


class Buffer:
    """tf that knows each frame 0.3 m above the base, turned upside down about x, at AT alone."""

    def lookup_transform(self, target, source, stamp, timeout):
        assert target == "base" and stamp == AT and timeout.to_sec() > 1.0
        height = {"right_hand_camera": 0.3, "right_hand_range": 0.25}[source]
        return TransformStamped(transform=Transform(Vector3(0.6, -0.2, height), Quaternion(1.0, 0.0, 0.0, 0.0)))


class Subscriber:
    """Hears one message each time that somebody looks whether there are enough; `alive`: those that still listen."""

    alive = []

    def __init__(self, message, kind, hear):
        assert isinstance(message, kind)
        self.more = lambda: hear(message)
        self.alive.append(self)

    def unregister(self):
        self.alive.remove(self)


def wait_for(test, timeout, timeout_msg):
    for _ in range(200):
        if test():
            return
        Subscriber.alive[-1].more()
    raise OSError(timeout_msg)


@pytest.fixture
def senses(monkeypatch):
    said = {
        "/cameras/right_hand_camera/image": Image(
            header=Header(stamp=AT, frame_id="right_hand_camera"), height=2, width=3, encoding="bgra8", step=12,
            data=bytes([10, 20, 30, 255] * 6)),
        "/cameras/right_hand_camera/camera_info": CameraInfo(K=[200.0, 0, 1.5, 0, 201.0, 0.5, 0, 0, 1]),
        "/robot/range/right_hand_range/state": Range(header=Header(stamp=AT), range=0.375)}
    monkeypatch.setattr(hand_senses.rospy, "Subscriber", lambda topic, kind, hear: Subscriber(said[topic], kind, hear))
    monkeypatch.setattr(hand_senses, "wait_for", wait_for)
    monkeypatch.setattr(hand_senses.tf2_ros, "Buffer", Buffer)
    monkeypatch.setattr(hand_senses.tf2_ros, "TransformListener", lambda buffer: None)
    return hand_senses.HandSenses("right")


def test_a_picture_is_red_green_blue_and_has_its_place(senses):
    view = senses.look()
    assert view.picture.shape == (2, 3, 3) and view.picture[0, 0].tolist() == [30, 20, 10]
    np.testing.assert_allclose(view.matrix, [[200.0, 0.0, 1.5], [0.0, 201.0, 0.5], [0.0, 0.0, 1.0]])
    # The middle of the picture shows what is straight below.
    np.testing.assert_allclose(view.on_plane([(1.5, 0.5), (201.5, 0.5)], -0.1), [(0.6, -0.2), (1.0, -0.2)], atol=1e-9)


def test_feeling_gives_height_and_readings(senses):
    height, readings = senses.feel()
    assert height == pytest.approx(0.25) and len(readings) == hand_senses.READINGS
    assert set(readings) == {0.375} and not Subscriber.alive


def test_a_sensor_that_is_silent_is_named(senses, monkeypatch):
    monkeypatch.setattr(hand_senses, "READINGS", 201)
    with pytest.raises(OSError, match="fewer than 201 messages came on /robot/range/right_hand_range/state in 30 s"):
        senses.feel()
    assert not Subscriber.alive
