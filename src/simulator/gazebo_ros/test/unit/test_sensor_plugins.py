# SPDX-License-Identifier: BSD-3-Clause
"""Sensors in a small physics world with known measurements."""
import io
import math

import numpy as np
import pytest
from gazebo_msgs.msg import ContactsState
from lxml import etree

from bullet_sim import Pose, World
from gazebo_ros import sensor_plugins
from gazebo_ros.drawn_sensor import DrawnSensor, Prosilica
from gazebo_ros.model_plugin import ModelPlugin, PluginContext, PluginError, PluginSource, with_tf_prefix
from gazebo_ros.plugin_table import PluginTable
from gazebo_ros.ray_pattern import RAYS_PER_TICK, RayPattern, RayPatternError
from gazebo_ros.urdf_extras import plugins
from gazebo_ros.urdf_extras import sensor_plugins as found_in
from lab_testing.closing import factory
from loop_ros.testing import FakeLog, FakeRos
from urdf_model import parse_urdf

BOX = """<robot name="box"><link name="link"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01"
ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
%s</robot>"""
ARM = """<robot name="arm"><link name="world"/><link name="boom"><inertial><mass value="1"/><inertia ixx="0.01"
iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="turn" type="continuous">
<parent link="world"/><child link="boom"/><axis xyz="0 0 1"/></joint>%s</robot>"""
RAY = """<gazebo reference="link"><sensor type="ray" name="s">%s<update_rate>50</update_rate><ray><scan><horizontal>
<samples>%d</samples><min_angle>-0.5</min_angle><max_angle>0.5</max_angle></horizontal></scan>
<range><min>0.15</min><max>5</max></range></ray><plugin name="p" filename="%s"><topicName>scan</topicName></plugin>
</sensor></gazebo>"""


class Lab:
    """A world with a floor, one model and its plugin."""

    def __init__(self, urdf, plugin_class, pose=None, static=True, parameters=None):
        self.world = World()
        self.world.add_ground_plane()
        robot = parse_urdf(urdf, "test")
        self.model = self.world.spawn(robot, "it", pose, static=static)
        element = (plugins(robot) + found_in(robot, warn=pytest.fail))[0]
        self.ros, self.log = FakeRos(), FakeLog()
        context = PluginContext(self.world, self.model, PluginSource(robot, element, "/ns", urdf), self.log, self.ros,
                                parameters or {})
        try:
            self.plugin = plugin_class(context)
        except PluginError:
            self.world.close()
            raise

    @property
    def publisher(self):
        (publisher,) = self.ros.publishers.values()
        return publisher

    def run(self, seconds):
        for _ in range(round(seconds / 0.002)):
            self.plugin.update(self.world.time_s, 0.002)
            self.world.step()
            self.plugin.publish(self.world.time_s)
        return self.publisher.messages


@pytest.fixture
def lab():
    with factory(Lab, "world") as made:
        yield made


def wall(world, x):
    """A box whose near face is at x."""
    world.spawn(parse_urdf(BOX % "", "wall"), "wall", Pose((x + 0.1, 0.0, 1.0)), static=True)


def test_a_laser_sees_a_wall_and_nothing_beside_it(lab):
    it = lab(BOX % (RAY % ("", 101, "libgazebo_ros_laser.so")), sensor_plugins.Laser, Pose((0, 0, 1)))
    wall(it.world, 1.0)
    scan = it.run(0.1)[0]
    assert (scan.angle_min, scan.angle_max, len(scan.ranges)) == (-0.5, 0.5, 101)
    assert scan.angle_increment == pytest.approx(0.01) and scan.header.frame_id == "link"
    assert list(it.ros.publishers) == ["/ns/scan"]
    assert scan.ranges[50] == pytest.approx(1.0, abs=1e-3)
    assert scan.ranges[55] == pytest.approx(1.0 / math.cos(0.05), abs=1e-3)
    assert math.isinf(scan.ranges[0])


def test_a_turned_sensor_looks_elsewhere(lab):
    it = lab(BOX % (RAY % ("<pose>0 0 0 0 1.5707963 0</pose>", 1, "libgazebo_ros_laser.so")), sensor_plugins.Laser,
             Pose((0, 0, 1)))
    assert it.run(0.1)[0].ranges[0] == pytest.approx(1.0, abs=1e-3)


def test_a_long_scan_is_swept_and_its_rate_holds(lab):
    it = lab(BOX % (RAY % ("", 3 * RAYS_PER_TICK, "libgazebo_ros_laser.so")), sensor_plugins.Laser, Pose((0, 0, 1)))
    sent = it.run(1.0)
    assert 49 <= len(sent) <= 51
    stamps = [message.header.stamp.to_sec() for message in sent]
    assert np.diff(stamps) == pytest.approx(0.02)


def test_nobody_listens_and_nothing_is_measured(lab):
    it = lab(BOX % (RAY % ("", 10, "libgazebo_ros_laser.so")), sensor_plugins.Laser, Pose((0, 0, 1)))
    it.world.ray_test_batch = None
    it.publisher.has_listeners = False
    assert it.run(0.1) == []


def test_a_range_finder_says_the_nearest_or_its_furthest(lab):
    it = lab(BOX % (RAY % ("", 5, "libgazebo_ros_range.so")), sensor_plugins.RangeFinder, Pose((0, 0, 1)))
    assert it.run(0.05)[-1].range == 5.0
    wall(it.world, 2.0)
    last = it.run(0.05)[-1]
    assert last.range == pytest.approx(2.0, abs=1e-3)
    assert (last.min_range, last.max_range, last.field_of_view) == pytest.approx((0.15, 5.0, 1.0))


def test_an_imu_at_rest_feels_gravity_and_in_free_fall_nothing(lab):
    plugin = """<gazebo><plugin filename="libgazebo_ros_imu.so"><topicName>imu</topicName><bodyName>link</bodyName>
<updateRate>100</updateRate></plugin></gazebo>"""
    standing = lab(BOX % plugin, sensor_plugins.ImuSensor, Pose((0, 0, 1), (0, math.sin(0.5), 0, math.cos(0.5))))
    felt = standing.run(0.1)[-1].linear_acceleration
    # Pitched by 1 rad: x points down.
    assert (felt.x, felt.y, felt.z) == pytest.approx((-9.81 * math.sin(1), 0, 9.81 * math.cos(1)), abs=1e-6)
    falling = lab(BOX % plugin, sensor_plugins.ImuSensor, Pose((0, 0, 5)), static=False)
    felt = falling.run(0.1)[-1].linear_acceleration
    assert abs(felt.z) < 0.05


def test_an_imu_measures_where_and_as_its_sensor_is_mounted(lab):
    imu = """<gazebo reference="%s"><sensor type="imu" name="s"><pose>%s</pose><plugin name="p"
filename="libgazebo_ros_imu_sensor.so"><topicName>imu</topicName></plugin></sensor></gazebo>"""
    upside_down = lab(BOX % (imu % ("link", "0 0 0 %r 0 0" % math.pi)), sensor_plugins.ImuSensor, Pose((0, 0, 1)))
    last = upside_down.run(0.05)[-1]
    assert last.linear_acceleration.z == pytest.approx(-9.81) and abs(last.orientation.x) == pytest.approx(1.0)
    on_a_boom = lab(ARM % (imu % ("boom", "0.5 0 0 0 0 0")), sensor_plugins.ImuSensor, Pose((0, 0, 1)))
    on_a_boom.model.drive_velocity(np.arange(1), np.array([2.0]), np.array([1e3]))
    last = on_a_boom.run(0.2)[-1]
    assert (last.linear_acceleration.x, last.angular_velocity.z) == pytest.approx((-0.5 * 2.0 ** 2, 2.0), rel=0.01)


@pytest.mark.parametrize(("parameters", "name", "expected"), [
    ({"ns": {"tf_prefix": "r1"}}, "laser", "r1/laser"), ({"tf_prefix": "/all/"}, "laser", "all/laser"),
    ({"tf_prefix": "all", "ns": {"tf_prefix": "r1"}}, "laser", "r1/laser"),
    ({"ns": {"tf_prefix": "r1"}}, "/odom", "odom"), ({"other": {"tf_prefix": "r1"}}, "laser", "laser"),
    ({"tf_prefix": 3}, "laser", "laser"), ({}, "laser", "laser")])
def test_frames_are_behind_the_tf_prefix(parameters, name, expected):
    assert with_tf_prefix(parameters, "/ns/arm", name) == expected


def test_a_laser_has_its_robots_tf_prefix(lab):
    it = lab(BOX % (RAY % ("", 9, "libgazebo_ros_laser.so")), sensor_plugins.Laser, Pose((0, 0, 1)),
             parameters={"ns": {"tf_prefix": "r1_tf"}})
    assert it.run(0.05)[-1].header.frame_id == "r1_tf/link"


@pytest.mark.parametrize(("elements", "pitch"), [
    ("", 0.4), ("<rpyOffset>0 0.3 0</rpyOffset>", 0.7),
    ("<initialOrientationAsReference>true</initialOrientationAsReference>", 0.0)])
def test_what_an_imu_counts_its_orientation_from(lab, elements, pitch):
    plugin = """<gazebo reference="link"><sensor type="imu" name="i"><plugin filename="libgazebo_ros_imu_sensor.so">
<topicName>imu</topicName><updateRateHZ>50</updateRateHZ>%s</plugin></sensor></gazebo>""" % elements
    it = lab(BOX % plugin, sensor_plugins.ImuSensor, Pose((0, 0, 1), (0, math.sin(0.2), 0, math.cos(0.2))))
    sent = it.run(1.0)
    assert 2.0 * math.asin(sent[-1].orientation.y) == pytest.approx(pitch, abs=1e-6)
    assert len(sent) == pytest.approx(50, abs=1)


def test_p3d_says_where_a_link_is(lab):
    plugin = """<gazebo><plugin filename="libgazebo_ros_p3d.so"><topicName>truth</topicName><bodyName>link</bodyName>
<xyzOffset>1 0 0</xyzOffset><updateRate>50</updateRate></plugin></gazebo>"""
    it = lab(BOX % plugin, sensor_plugins.PoseSensor, Pose((1, 2, 5)), static=False)
    last = it.run(0.1)[-1]
    assert last.header.frame_id == "world" and last.child_frame_id == "link"
    assert (last.pose.pose.position.x, last.pose.pose.position.y) == pytest.approx((2.0, 2.0))
    assert last.twist.twist.linear.z == pytest.approx(-9.81 * last.header.stamp.to_sec(), abs=0.03)


@pytest.mark.parametrize(("noise", "spread", "warnings"), [("-0.1", 0.1, 0), ("0.1", 0.1, 0), ("1e300", 1e12, 1)])
def test_a_noise_may_be_negative_and_is_bounded(lab, noise, spread, warnings):
    plugin = """<gazebo><plugin filename="libgazebo_ros_p3d.so"><topicName>truth</topicName><bodyName>link</bodyName>
<gaussianNoise>%s</gaussianNoise></plugin></gazebo>""" % noise
    it = lab(BOX % plugin, sensor_plugins.PoseSensor, Pose((1, 2, 5)))
    speeds = [message.twist.twist.linear.x for message in it.run(1.0)]
    assert len(speeds) == 500 and np.std(speeds) == pytest.approx(spread, rel=0.2)
    assert len(it.log.of("warn")) == warnings


@pytest.mark.parametrize(("old", "new"), [("<update_rate>50<", "<update_rate>1e-300<"), ("<max>5<", "<max>1e300<"),
                                          (">-0.5<", ">-1e300<")])
def test_a_scan_with_absurd_numbers_fits_into_a_message(lab, old, new):
    ray = RAY % ("", 3, "libgazebo_ros_laser.so")
    assert old in ray
    it = lab(BOX % ray.replace(old, new), sensor_plugins.Laser, Pose((0, 0, 1)))
    it.run(0.1)[0].serialize(io.BytesIO())


def test_a_bumper_feels_the_weight(lab):
    plugin = """<gazebo reference="link"><sensor type="contact" name="b"><plugin filename="libgazebo_ros_bumper.so">
<bumperTopicName>bump</bumperTopicName></plugin></sensor></gazebo>"""
    it = lab(BOX % plugin, sensor_plugins.Bumper, Pose((0, 0, 0.3)), static=False)
    assert it.run(0.02)[-1].states == []
    (state,) = it.run(1.5)[-1].states
    assert it.publisher.msg_class is ContactsState
    assert (state.collision1_name, state.collision2_name) == (
        "it::link::link_collision", "ground_plane::link::collision")
    assert state.total_wrench.force.z == pytest.approx(2 * 9.81, rel=0.05)
    assert all(normal.z > 0.99 for normal in state.contact_normals)
    for _ in range(100):
        it.model.apply_wrench("link", (3.0, 0.0, 0.0))
        it.run(0.002)
    (state,) = it.publisher.messages[-1].states
    # Friction holds against the push.
    assert state.total_wrench.force.x == pytest.approx(-3.0, abs=0.1)


def test_joint_states(lab):
    plugin = ('<gazebo><plugin filename="libgazebo_ros_joint_state_publisher.so"><jointName>%s</jointName></plugin>'
              '</gazebo>')
    it = lab(ARM % (plugin % "turn"), sensor_plugins.JointStatePublisher)
    it.model.set_joint_positions(np.array([0]), np.array([0.7]))
    last = it.run(0.01)[-1]
    assert last.name == ["turn"] and last.position == pytest.approx([0.7])
    with pytest.raises(PluginError, match="nose, expected some of turn"):
        lab(ARM % (plugin % "nose"), sensor_plugins.JointStatePublisher)


def test_after_a_reset_of_time_sensors_go_on(lab):
    it = lab(BOX % (RAY % ("", 1, "libgazebo_ros_laser.so")), sensor_plugins.Laser, Pose((0, 0, 1)))
    before = len(it.run(1.0))
    it.world.reset_time()
    it.plugin.reset()
    assert len(it.run(0.1)) >= before + 5


@pytest.mark.parametrize(("element", "text"), [
    ("<range><min>2</min><max>1</max></range>", "from 2 to 1 m"), ("<range><min>x</min></range>", "'x'"),
    ("<scan><horizontal><samples>0</samples></horizontal></scan>", "0 samples"),
    ("<scan><horizontal><samples>1e9</samples></horizontal></scan>", "at most")])
def test_impossible_rays_are_refused(element, text):
    with pytest.raises(RayPatternError, match=text):
        RayPattern(etree.fromstring("<ray>%s</ray>" % element), "it")


ANGLES = "<%s><samples>3</samples><min_angle>%g</min_angle><max_angle>%g</max_angle></%s>"


@pytest.mark.parametrize(("axis", "low", "high", "remarks"), [
    ("horizontal", 1, -1, 0), ("vertical", -0.1, -0.35, 0), ("horizontal", -28, 28, 1), ("horizontal", 0, 7, 1)])
def test_rays_may_go_from_left_to_right_and_more_than_once_round_as_in_gazebo(axis, low, high, remarks):
    pattern = RayPattern(etree.fromstring("<ray><scan>%s</scan></ray>" % (ANGLES % (axis, low, high, axis))), "it")
    middle = (low + high) / 2
    turns = [(math.cos(angle), math.sin(angle)) for angle in (low, middle, high)]
    across = pattern.directions[-3:] if axis == "horizontal" else pattern.directions[320::640]
    along = [np.hypot(x, y) for x, y, _ in across] if axis == "vertical" else across[:, 0]
    np.testing.assert_allclose(np.column_stack([along, across[:, 2 if axis == "vertical" else 1]]), turns, atol=1e-9)
    assert pattern.field == pytest.approx(abs(high - low)) and len(pattern.remarks) == remarks
    assert pattern.increment == pytest.approx((high - low) / 2 if axis == "horizontal" else 0.0)


def test_a_laser_may_look_all_round(lab):
    """As turtlebot3's, from 0 to 6.28319."""
    ray = (RAY % ("", 360, "libgazebo_ros_laser.so")).replace("-0.5", "0.0").replace("0.5</max", "6.28319</max")
    it = lab(BOX % ray, sensor_plugins.Laser, Pose((0, 0, 1)))
    wall(it.world, 1.0)
    scan = it.run(1.0)[-1]
    assert (scan.angle_min, scan.angle_max) == pytest.approx((0.0, 6.28319))
    assert scan.ranges[0] == pytest.approx(1.0, abs=0.01) and math.isinf(scan.ranges[180])
    assert scan.intensities == (0.0,) * 360


def test_missing_elements_are_named(lab):
    with pytest.raises(PluginError, match="names no topic; expected <topicName>"):
        lab(BOX % '<gazebo><plugin filename="libgazebo_ros_p3d.so"/></gazebo>', sensor_plugins.PoseSensor)


def test_without_a_ray_element_it_is_that_of_sdf(lab):
    plugin = lab(BOX % '<gazebo reference="link"><sensor name="s"><plugin filename="x"><topicName>a</topicName>'
                 '</plugin></sensor></gazebo>', sensor_plugins.Laser).plugin
    assert (plugin.pattern.columns, plugin.pattern.rows, plugin.pattern.angle_max) == (640, 1, 0.0)


@pytest.mark.parametrize(("reference", "text"), [("nose", "on link 'nose'"), ("turn", "on a joint, 'turn'")])
def test_a_sensor_that_is_on_no_link_is_left_out_with_a_warning(reference, text):
    said = []
    elements = '<gazebo reference="%s"><sensor name="a"><plugin filename="x"/></sensor></gazebo>' \
        '<gazebo reference="boom"><sensor name="b"><plugin filename="y"/></sensor></gazebo>' % reference
    found = found_in(parse_urdf(ARM % elements, "test"), said.append)
    assert [plugin.get("filename") for plugin in found] == ["y"]
    assert len(said) == 1 and text in said[0] and "left out" in said[0]


def test_sensors_may_be_left_out_and_control_logic_not():
    assert not sensor_plugins.Laser.required and not sensor_plugins.PoseSensor.required
    assert not DrawnSensor.required and ModelPlugin.required


@pytest.mark.parametrize(("parameters", "warnings"), [({}, 0), ({"trigger_mode": "polled"}, 1)])
def test_a_prosilica_that_is_to_be_polled_streams_and_says_so(parameters, warnings):
    log = FakeLog()
    world = World()
    robot = parse_urdf('<robot name="r"><link name="a"/></robot>')
    source = PluginSource(robot, etree.fromstring('<plugin filename="libgazebo_ros_prosilica.so"/>'), "/eye", "")
    Prosilica(PluginContext(world, world.spawn(robot, "r"), source, log, FakeRos(), {"eye": parameters}))
    assert len(log.of("warn")) == warnings
    world.close()


def test_all_file_names_lead_to_classes():
    import os
    path = os.path.join(os.path.dirname(__file__), "..", "..", "config", "model_plugins.yaml")
    table = PluginTable.from_yaml(path)
    for filename in table.known:
        if filename.startswith("libgazebo_ros_") and filename != "libgazebo_ros_control.so":
            assert table.find(filename) is not None
