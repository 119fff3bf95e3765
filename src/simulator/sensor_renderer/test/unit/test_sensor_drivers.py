# SPDX-License-Identifier: BSD-3-Clause
"""From a description to messages: the <sensor> element, when a picture is due, the messages."""
import numpy as np
import pytest
from dynamic_reconfigure.msg import BoolParameter, Config, DoubleParameter, IntParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from lxml import etree
from sensor_msgs.msg import PointField

from sensor_renderer import best, convert, drivers, node, topics
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
    return SensorEntry("robot", {"link": "base", "frame": "ns/eye", "offset": np.eye(4).ravel().tolist(), "plugin": 0,
                                 "namespace": "/ns", "xml": SENSOR % (rate, camera, own_rate)})


def test_a_camera_as_it_is_written():
    found = entry()
    (camera,) = found.cameras()
    assert (found.filename, found.rate, found.frame) == ("libgazebo_ros_camera.so", 10.0, "ns/eye")
    assert found.text("cameraName", found.name) == "eye"
    assert (camera.pinhole.width, camera.pinhole.height, camera.encoding) == (64, 48, "rgb8")
    # A sensor looks along x of its frame: z of the optical one; and down is down.
    assert camera.offset[:3, 2] == pytest.approx([1, 0, 0]) and camera.offset[:3, 1] == pytest.approx([0, 0, -1])
    assert camera.offset[:3, 3] == pytest.approx([0, 0, 1])
    assert entry(own_rate="25").rate == 25.0


@pytest.mark.parametrize(("names", "baselines"), [(("left", "right"), [0.0, 0.07]), (("eye",), [0.07])])
def test_of_a_pair_of_cameras_the_right_one_has_the_baseline(names, baselines):
    found = entry(camera="".join('<camera name="%s"/>' % name for name in names))
    etree.SubElement(found.plugin, "hackBaseline").text = "0.07"
    assert [found.baseline_m(camera) for camera in found.cameras()] == baselines


def test_camera_info_states_what_the_plugin_says():
    found = entry(own_rate="0</updateRate><focalLength>60.0</focalLength><Cx>30</Cx><Cy>0.0</Cy><updateRate>0")
    (camera,) = found.cameras()
    info = convert.camera_info(found.stated(camera.pinhole))
    assert (info.K[0], info.K[2], info.K[4], info.K[5]) == (60.0, 30.0, 60.0, camera.pinhole.cy)
    assert info.P[:3] == [60.0, 0.0, 30.0] and found.cameras()[0].pinhole == camera.pinhole


def test_without_a_camera_element_it_is_that_of_sdf():
    pinhole = entry(camera="").cameras()[0].pinhole
    assert (pinhole.width, pinhole.height, pinhole.near, pinhole.far) == (320, 240, 0.1, 100)
    assert 2.0 * np.arctan(160.0 / pinhole.fx) == pytest.approx(1.047)


@pytest.mark.parametrize(("options", "text"), [
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
    def no_egl(still):
        raise RenderingError("no OpenGL 3.3 on EGL: libEGL.so not found")

    said = []
    monkeypatch.setattr(best, "GlRenderer", no_egl)
    monkeypatch.setattr(node.rospy, "logwarn", said.append)
    monkeypatch.setattr(node.rospy, "loginfo", said.append)
    renderer = node.make_renderer()
    assert isinstance(renderer, TinyRenderer)
    assert "libEGL.so not found" in said[0] and "Install libegl1" in said[0]
    renderer.close()


class Opened:
    """A publisher or service that records what it is asked."""

    def __init__(self, ros, *arguments, **_):
        self.arguments, self.sent, self.open = arguments, [], True
        ros.opened.append(self)

    def publish(self, message):
        self.sent.append(message)

    def unregister(self, *_):
        self.open = False

    shutdown = unregister
    get_num_connections = staticmethod(lambda: 1)


class Ros:
    """The topics that cameras have opened, and the parameters that they find."""

    def __init__(self, monkeypatch):
        self.opened, self.parameters = [], {}
        for kind in ("Publisher", "Service", "Subscriber"):
            monkeypatch.setattr(topics.rospy, kind, lambda *arguments, **_: Opened(self, *arguments))
        monkeypatch.setattr(topics.rospy, "get_param", lambda name, default: self.parameters.get(name, default))

    def names(self):
        return [opened.arguments[0] for opened in self.opened if opened.open]

    def change(self, name, **values):
        """As a client of dynamic_reconfigure does."""
        config = Config()
        for key, value in values.items():
            kind, field = {bool: (BoolParameter, config.bools), int: (IntParameter, config.ints),
                           float: (DoubleParameter, config.doubles)}[type(value)]
            field.append(kind(key, value))
        handler, = (opened.arguments[-1] for opened in self.opened
                    if opened.open and opened.arguments[0] == name + "/set_parameters")
        return handler(ReconfigureRequest(config))

    def sent(self, name):
        found, = (opened for opened in self.opened if opened.open and opened.arguments[0] == name)
        return found.sent


@pytest.fixture
def ros(monkeypatch):
    return Ros(monkeypatch)


class Still:
    """A moment of a world that does not move; everything is drawn as `picture`."""

    def __init__(self, time_s, picture=None, depth=None):
        self.time_s, self.picture, self.depth = time_s, picture, depth

    def at(self, time_s):
        return Still(time_s, self.picture, self.depth)

    def is_still(self, seconds):
        return True

    def draw(self, pinhole, offset, colour, depth):
        return self.picture, self.depth


def test_settings_are_served_once_and_felt_at_once(ros):
    camera = drivers.Camera(entry())
    assert "/ns/eye/image_raw/compressed/set_parameters" in ros.names() and "/ns/eye/parameter_updates" in ros.names()
    ros.change("/ns/eye/image_raw/compressed", jpeg_quality=5)
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3)).astype(np.uint8)

    def taken(time_s):
        camera.take(Still(time_s, noise))
        return len(ros.sent("/ns/eye/image_raw/compressed")[-1].data)

    small = taken(0.0)
    ros.change("/ns/eye/image_raw/compressed", jpeg_quality=90)
    assert taken(1.0) > 2 * small
    assert not camera.is_due(1.05)
    ros.change("/ns/eye", imager_rate=100.0)
    assert camera.is_due(1.05)
    camera.close()
    assert not any(opened.open for opened in ros.opened)


def test_exposure_and_noise_come_from_parameters_and_change_at_run_time(ros):
    ros.parameters.update({"/ns/eye": {"exposure_time": 0.02, "imager_rate": 20}, "/sensor_renderer": {"gain": -6.0}})
    camera = drivers.Camera(entry())
    grey = np.full((48, 64, 3), 100, dtype=np.uint8)
    assert camera.memory_s == 0.02 and camera.is_due(0.0)
    camera.take(Still(1.0, grey))
    image = ros.sent("/ns/eye/image_raw")[-1]
    assert image.header.stamp.to_sec() == pytest.approx(0.99), "the middle of the exposure"
    assert abs(np.frombuffer(image.data, np.uint8).mean() - 100.0) < 1.5, "twice the time, half the gain"
    ros.change("/ns/eye", exposure_time=0.0, gain=0.0, noise_stddev=0.1)
    camera.take(Still(2.0, grey))
    assert np.frombuffer(ros.sent("/ns/eye/image_raw")[-1].data, np.uint8).std() == pytest.approx(25.5, rel=0.05)
    assert camera.memory_s == 0.0


@pytest.mark.parametrize(("name", "value", "text"), [
    ("exposure_time", 5, "parameter exposure_time of camera /ns/eye is 5, expected 0 to 0.1"),
    ("gain", "high", "parameter gain of camera /ns/eye is 'high', expected a number"),
    ("gain", True, "is True, expected a number"), ("auto_exposure", 1, "is 1, expected true or false")])
def test_parameters_that_are_of_no_use_are_refused(ros, name, value, text):
    ros.parameters["/ns/eye"] = {name: value}
    with pytest.raises(SensorError, match=text):
        drivers.Camera(entry())


def test_topics_for_learning_come_and_go_by_a_setting(ros):
    camera = drivers.Camera(entry())
    wanted = {"/ns/eye/" + name for name in ("semantic/image_raw", "semantic/labels", "instance/image_raw",
                                             "instance/labels", "ideal_depth/image_raw", "flow/image_raw")}
    assert not wanted & set(ros.names())
    ros.change("/ns/eye", learning_topics=True)
    assert wanted <= set(ros.names())
    ros.change("/ns/eye", learning_topics=False)
    assert not wanted & set(ros.names())
    ros.change("/ns/eye", learning_topics=True)
    camera.close()
    assert not ros.names()


def test_the_kinect_measures_as_one_when_it_is_asked_to(ros):
    kinect = drivers.DepthCamera(entry(camera=CAMERA % ("640", "R8G8B8")))
    flat = np.full((48, 640), 2.0, dtype=np.float32)
    picture = np.zeros((48, 640, 3), dtype=np.uint8)

    def measured(time_s):
        kinect.take(Still(time_s, picture, flat))
        return np.frombuffer(ros.sent("/ns/eye/depth/image_raw")[-1].data, np.float32)

    assert (measured(0.0) == 2.0).all()
    ros.change("/ns/eye", depth_noise=True)
    noisy = measured(1.0)
    assert 0.003 < np.nanstd(noisy) < 0.01 and abs(np.nanmean(noisy) - 2.0) < 0.002
    ros.change("/ns/eye", depth_noise=False)
    assert (measured(2.0) == 2.0).all()


@pytest.mark.parametrize(("noise", "found"), [
    ("<noise><type>gaussian</type><mean>0.1</mean><stddev>0.02</stddev></noise>", (0.02, 0.1)),
    ("<noise><type>none</type><stddev>0.02</stddev></noise>", (0.0, 0.0)), ("", (0.0, 0.0))])
def test_noise_as_gazebo_describes_it(noise, found):
    camera, = entry(camera="<camera>%s</camera>" % noise).cameras()
    assert (camera.noise, camera.noise_mean) == found


@pytest.mark.parametrize(("noise", "text"), [
    ("<noise><type>custom</type></noise>", "<type> of its <noise> is 'custom', expected gaussian or none"),
    ("<noise><stddev>-1</stddev></noise>", "<noise/stddev> is -1, expected 0 or more")])
def test_noise_that_is_of_no_use_is_said(noise, text):
    with pytest.raises(SensorError, match=text):
        entry(camera="<camera>%s</camera>" % noise).cameras()


def test_names_that_are_none_are_refused():
    with pytest.raises(SensorError, match="'/n s/eye' is not a name in ROS"):
        drivers.Driver(SensorEntry("robot", {
            "link": "base", "frame": "ns/eye", "offset": np.eye(4).ravel().tolist(), "plugin": 0, "namespace": "/n s",
            "xml": SENSOR % ("10", "", "0")})).name("eye")


def test_a_triggered_camera_takes_a_picture_for_each_trigger(ros, monkeypatch):
    camera = drivers.TriggeredCamera(entry(rate="0", camera="".join(
        (CAMERA % ("64", "R8G8B8")).replace("<camera>", '<camera name="%s">' % side) for side in ("left", "right"))))
    triggers = {opened.arguments[0]: opened.arguments[-1] for opened in ros.opened
                if opened.arguments[0].endswith("image_trigger")}
    assert set(triggers) == {"/ns/eye/left/image_trigger", "/ns/eye/right/image_trigger"}
    picture = np.zeros((48, 64, 3), dtype=np.uint8)

    def pictures():
        while camera.is_due(1.0):
            camera.take(Still(1.0, picture))
        return [len(ros.sent("/ns/eye/%s/image_raw" % side)) for side in ("left", "right")]

    assert pictures() == [0, 0]
    for side, count in (("left", 2), ("right", 1)):
        for _ in range(count):
            triggers["/ns/eye/%s/image_trigger" % side](None)
    assert pictures() == [2, 1]
    with monkeypatch.context() as nobody:
        nobody.setattr(Opened, "get_num_connections", staticmethod(lambda: 0))
        triggers["/ns/eye/left/image_trigger"](None)
        assert not camera.is_due(1.0)
    assert pictures() == [2, 1], "nobody looked"
    camera.close()
    assert not ros.names()
