# SPDX-License-Identifier: BSD-3-Clause
"""From a description to messages: the <sensor> element, when a picture is due, the messages."""
import numpy as np
import pytest
from dynamic_reconfigure.msg import Config, DoubleParameter, IntParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from sensor_msgs.msg import PointField

from sensor_renderer import convert, drivers, node
from sensor_renderer.errors import RenderingError, SensorError
from sensor_renderer.pictures import Cloud, Noise, encoded, millimetres, within
from sensor_renderer.pinhole import Pinhole
from sensor_renderer.sensor_element import SensorEntry
from sensor_renderer.tiny_renderer import TinyRenderer

SENSOR = """<sensor type="camera" name="eye"><pose>0 0 1 0 0 0</pose><update_rate>%s</update_rate>%s
<plugin name="p" filename="/opt/lib/libgazebo_ros_camera.so"><frameName> eye_frame </frameName>
<updateRate>%s</updateRate></plugin></sensor>"""
CAMERA = "<camera><image><width>%s</width><height>48</height><format>%s</format></image></camera>"


def entry(rate="10", camera=CAMERA % ("64", "R8G8B8"), own_rate="0"):
    return SensorEntry("robot", {"link": "base", "member": "head", "offset": np.eye(4).ravel().tolist(), "plugin": 0,
                                 "namespace": "/ns", "xml": SENSOR % (rate, camera, own_rate)})


def test_a_camera_as_it_is_written():
    found = entry()
    (camera,) = found.cameras()
    assert (found.filename, found.rate, found.text("frameName", "x")) == ("libgazebo_ros_camera.so", 10.0, "eye_frame")
    assert found.text("cameraName", found.name) == "eye"
    assert (camera.pinhole.width, camera.pinhole.height, camera.encoding) == (64, 48, "rgb8")
    # A sensor looks along x of its frame: z of the optical one; and down is down.
    assert camera.offset[:3, 2] == pytest.approx([1, 0, 0]) and camera.offset[:3, 1] == pytest.approx([0, 0, -1])
    assert camera.offset[:3, 3] == pytest.approx([0, 0, 1])
    assert entry(own_rate="25").rate == 25.0


@pytest.mark.parametrize(("options", "text"), [
    ({"camera": ""}, "sensor 'eye' of model 'robot' has no <camera> element"),
    ({"camera": CAMERA % ("999999", "R8G8B8")}, "999999 x 48 pixels"),
    ({"camera": CAMERA % ("wide", "R8G8B8")}, "<image/width> is 'wide', expected a number"),
    ({"camera": CAMERA % ("64", "BAYER_XYZ")}, "format 'BAYER_XYZ' is not known"),
    ({"camera": "<camera><pose>1 2</pose></camera>"}, "<pose> is '1 2', expected six numbers"),
    ({"rate": "often"}, "<update_rate> is 'often'")])
def test_what_cannot_be_used_is_said(options, text):
    with pytest.raises(SensorError, match=text):
        entry(**options).cameras()


def test_encodings_and_noise():
    picture = np.zeros((2, 3, 3), dtype=np.uint8)
    picture[0, 0] = (10, 20, 30)
    assert encoded(picture, "rgb8")[0][:3] == bytes((10, 20, 30)) and encoded(picture, "rgb8")[1] == 9
    assert encoded(picture, "bgr8")[0][:3] == bytes((30, 20, 10))
    assert encoded(picture, "bgra8")[0][:4] == bytes((30, 20, 10, 255)) and encoded(picture, "bgra8")[1] == 12
    assert len(encoded(picture, "mono8")[0]) == 6
    grey = np.full((200, 300, 3), 128, dtype=np.uint8)
    assert Noise(0.02).add(grey).astype(float).std() == pytest.approx(0.02 * 255, rel=0.05)
    assert not np.array_equal(Noise(0.02).add(grey), grey)


def test_depth_and_points_agree_with_the_pinhole():
    pinhole = Pinhole.from_field_of_view(64, 48, 1.0, 0.1, 10.0)
    depth = np.full((48, 64), 2.0, dtype=np.float32)
    depth[0, 0], depth[0, 1] = 0.3, 9.0
    cut = within(depth, 0.4, 5.0)
    assert np.isnan(cut[0, :2]).all() and np.isnan(cut).sum() == 2
    assert millimetres(cut)[0, 0] == 0 and millimetres(cut)[5, 5] == 2000
    picture = np.zeros((48, 64, 3), dtype=np.uint8)
    picture[10, 20] = (1, 2, 3)
    message = convert.point_cloud(Cloud(pinhole).points(cut, picture))
    assert [(field.name, field.offset, field.datatype) for field in message.fields] == [
        (name, 4 * k, PointField.FLOAT32) for k, name in enumerate(("x", "y", "z", "rgb"))]
    assert len(message.data) == message.row_step * message.height
    row = message.data[10 * message.row_step + 20 * 16:][:16]
    assert pinhole.project([np.frombuffer(row[:12], np.float32)])[0] == pytest.approx([20, 10], abs=1e-4)
    assert row[12:15] == bytes((3, 2, 1))


def test_without_egl_pictures_come_from_pybullet_and_that_is_said(monkeypatch):
    def no_egl():
        raise RenderingError("no OpenGL 3.3 on EGL: libEGL.so not found")

    said = []
    monkeypatch.setattr(node, "GlRenderer", no_egl)
    monkeypatch.setattr(node.rospy, "logwarn", said.append)
    monkeypatch.setattr(node.rospy, "loginfo", said.append)
    renderer = node.make_renderer()
    assert isinstance(renderer, TinyRenderer)
    assert "libEGL.so not found" in said[0] and "Install libegl1" in said[0]
    renderer.close()


def test_settings_are_served_once_and_felt_at_once(monkeypatch):
    class Opened:
        def __init__(self, *arguments, **_):
            self.arguments, self.sent, self.open = arguments, [], True
            found.append(self)

        def publish(self, message):
            self.sent.append(message)

        def unregister(self, *_):
            self.open = False

        shutdown = unregister
        get_num_connections = staticmethod(lambda: 1)

    found = []
    monkeypatch.setattr(drivers.rospy, "Publisher", Opened)
    monkeypatch.setattr(drivers.rospy, "Service", Opened)
    camera = drivers.Camera(entry())
    names = [opened.arguments[0] for opened in found]
    assert "/ns/eye/image_raw/compressed/set_parameters" in names and "/ns/eye/parameter_updates" in names
    handler = {opened.arguments[0]: opened.arguments[-1] for opened in found}
    handler["/ns/eye/image_raw/compressed/set_parameters"](ReconfigureRequest(Config(ints=[
        IntParameter("jpeg_quality", 5)])))
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3)).astype(np.uint8)

    def taken(time_s):
        camera.take(time_s, np.eye(4), lambda *_: (noise, None))
        compressed, = (opened for opened in found if opened.arguments[0] == "/ns/eye/image_raw/compressed")
        return len(compressed.sent[-1].data)

    small = taken(0.0)
    handler["/ns/eye/image_raw/compressed/set_parameters"](ReconfigureRequest(Config(ints=[
        IntParameter("jpeg_quality", 90)])))
    assert taken(1.0) > 2 * small
    assert not camera.is_due(1.05)
    handler["/ns/eye/set_parameters"](ReconfigureRequest(Config(doubles=[DoubleParameter("imager_rate", 100.0)])))
    assert camera.is_due(1.05)
    camera.close()
    assert not any(opened.open for opened in found)


def test_names_that_are_none_are_refused():
    with pytest.raises(SensorError, match="'/n s/eye' is not a name in ROS"):
        drivers.Driver(SensorEntry("robot", {
            "link": "base", "member": "head", "offset": np.eye(4).ravel().tolist(), "plugin": 0, "namespace": "/n s",
            "xml": SENSOR % ("10", "", "0")})).name("eye")
