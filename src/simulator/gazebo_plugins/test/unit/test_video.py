# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a topic on visuals."""
import numpy as np
import pytest
from sensor_msgs.msg import Image

from bullet_sim import World
from gazebo_plugins.video import Video
from gazebo_ros.model_plugin import PluginContext, PluginError, PluginHost, PluginSource
from gazebo_ros.urdf_extras import plugins, visual_plugins
from loop_ros.testing import FakeLog, FakeRos
from sdf_model import parse_sdf_model
from urdf_model import parse_urdf

PLUGIN = '<plugin name="p" filename="libgazebo_ros_video.so"><topicName>film</topicName>%s</plugin>'
URDF = """<robot name="tv"><link name="base"/><link name="glass"><visual><origin xyz="0 0 1" rpy="1.5708 0 0"/>
<geometry><box size="0.8 0.6 0.02"/></geometry></visual></link><joint name="j" type="fixed"><parent link="base"/>
<child link="glass"/></joint>%s</robot>"""
SDF = """<sdf version="1.6"><model name="tv"><link name="glass"><visual name="back"><geometry><box><size>1 1 1</size>
</box></geometry></visual><visual name="front"><pose>0 0 1 1.5708 0 0</pose><geometry><box><size>0.8 0.6 0.02</size>
</box></geometry>%s</visual></link></model></sdf>"""


class Screen:
    shown = None

    def show(self, pixels):
        self.shown = pixels.copy()


class Lab:
    def __init__(self, robot):
        self.world, self.log, self.ros, self.screens = World(), FakeLog(), FakeRos(), []
        model = self.world.spawn(robot, "tv")
        element, = visual_plugins(robot) + plugins(robot)
        host = PluginHost(lambda *made: self.screens.append((*made, Screen())) or self.screens[-1][-1])
        try:
            source = PluginSource(robot, element, "")
            self.plugin = Video(PluginContext(self.world, model, source, self.log, self.ros, {}, host))
        finally:
            self.world.close()

    def show(self, pixels, encoding="rgb8", step=None):
        height, width, channels = pixels.shape
        self.ros.subscriptions["/film"].put(Image(height=height, width=width, encoding=encoding, data=pixels.tobytes(),
                                                  step=width * channels if step is None else step))
        self.plugin.update(0.0, 0.001)
        return self.screens[0][-1].shown


@pytest.mark.parametrize("robot", [
    lambda inside: parse_urdf(URDF % ('<gazebo reference="glass"><visual>%s</visual></gazebo>' % PLUGIN % inside)),
    lambda inside: parse_sdf_model(SDF % (PLUGIN % inside), "tv.sdf").robot])
def test_a_topic_is_shown_above_its_visual(robot):
    lab = Lab(robot("<width>4</width><height>2</height>"))
    (link, place, size, pixels, glows, radius, _), = lab.screens
    assert (link, size, pixels, glows, radius) == ("glass", (0.8, 0.6), (4, 2), False, 0.0)
    np.testing.assert_allclose(place[:3, 3], (0, -0.51 * 0.02, 1), atol=1e-6)
    np.testing.assert_allclose(place[:3, 2], (0, -1, 0), atol=1e-5)
    picture = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    np.testing.assert_array_equal(lab.show(picture), picture)
    np.testing.assert_array_equal(lab.show(picture, "bgr8"), picture[:, :, ::-1])
    large = picture.repeat(3, axis=0).repeat(2, axis=1)
    np.testing.assert_array_equal(lab.show(large), picture)
    np.testing.assert_array_equal(lab.show(picture[:1, :1]), np.broadcast_to(picture[0, 0], (2, 4, 3)))
    np.testing.assert_array_equal(lab.show(picture[:, :, :1], "mono8"), picture[:, :, :1].repeat(3, axis=2))


@pytest.mark.parametrize("shape, encoding, step, words", [
    ((2, 2, 3), "yuv422", None, "yuv422"), ((2, 2, 3), "rgb8", 600, "12 bytes, 600 a row"),
    ((2, 2, 1), "rgb8", 2, "2 x 2 pixels of rgb8")])
def test_a_picture_that_is_none_is_named_and_the_last_one_stays(shape, encoding, step, words):
    lab = Lab(parse_urdf(URDF % ('<gazebo reference="glass"><visual>%s</visual></gazebo>' % PLUGIN % "")))
    first = lab.show(np.full((240, 320, 3), 7, np.uint8))
    np.testing.assert_array_equal(lab.show(np.zeros(shape, np.uint8), encoding, step), first)
    assert words in lab.log.of("warn")[0]


@pytest.mark.parametrize("block, words", [
    ('<gazebo reference="glass">%s</gazebo>' % PLUGIN % "", "outside of a <visual>"),
    ('<gazebo reference="base"><visual>%s</visual></gazebo>' % PLUGIN % "", "'base' has no visual"),
    ('<gazebo reference="glass"><visual>%s</visual></gazebo>' % PLUGIN % "<width>1e9</width>", "<width> is '1e9'")])
def test_what_cannot_be_shown_is_refused_with_the_reason(block, words):
    with pytest.raises(PluginError, match=words):
        Lab(parse_urdf(URDF % block))
