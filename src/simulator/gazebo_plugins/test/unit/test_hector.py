# SPDX-License-Identifier: BSD-3-Clause
"""Sensors of hector_gazebo_plugins, with known measurements."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Vector3Stamped
from sensor_msgs.msg import MagneticField
from std_srvs.srv import EmptyRequest

from bullet_sim import Pose
from gazebo_plugins.error_model import ErrorModel
from gazebo_plugins.globe import Reference
from gazebo_plugins.hector import HectorGps, HectorImu, HectorMagnetic, HectorSonar
from gazebo_ros.model_plugin import PluginError

BOX = """<robot name="box"><link name="link"><inertial><mass value="2"/>
<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>%s</robot>"""
RAYS = """<gazebo reference="link"><sensor type="ray" name="s"><pose>0 0 -0.11 0 1.5708 0</pose>
<update_rate>20</update_rate><ray><scan><horizontal><samples>3</samples>
<min_angle>-0.1</min_angle><max_angle>0.1</max_angle></horizontal></scan>
<range><min>0.02</min><max>3</max></range></ray>%s</sensor></gazebo>"""


def vector(message):
    return np.array([message.x, message.y, message.z])


def leaning(roll):
    return Pose((0, 0, 2), (math.sin(roll / 2), 0, 0, math.cos(roll / 2)))


def test_an_imu_at_rest_feels_gravity_upwards_and_in_a_fall_nothing(make):
    lab = make(BOX, HectorImu, {"topicName": "raw_imu", "updateRate": 100}, Pose((0, 0, 0.1))).run(0.3)
    message = lab.sent("raw_imu")[-1]
    np.testing.assert_allclose(vector(message.linear_acceleration), (0, 0, 9.81), atol=0.05)
    assert message.header.frame_id == "link" and abs(message.orientation.w) == pytest.approx(1.0, abs=1e-6)
    assert len(lab.sent("raw_imu")) == pytest.approx(30, abs=1)
    falling = make(BOX, HectorImu, {"frameId": "imu"}, leaning(0.3)).run(0.2)
    message = falling.sent("imu")[-1]
    np.testing.assert_allclose(vector(message.linear_acceleration), 0.0, atol=1e-6)
    assert message.header.frame_id == "imu" and 2 * math.asin(message.orientation.x) == pytest.approx(0.3)


def test_an_imu_turns_with_its_link_and_its_offset(make):
    lab = make(BOX, HectorImu, {"rpyOffset": "3.14159265 0 0"}, Pose((0, 0, 2)))
    lab.model.set_base_twist((0, 0, 0), (0, 0, 2.0))
    message = lab.run(0.1).sent("imu")[-1]
    np.testing.assert_allclose(vector(message.angular_velocity), (0, 0, -2.0), atol=1e-3)


def test_an_imus_bias_is_told_and_calibration_ends_that_of_the_rates(make):
    lab = make(BOX, HectorImu, {"rateOffset": "0.01 0.02 0.03", "accelOffset": 0.5, "accelGaussianNoise": 0.2},
               Pose((0, 0, 0.1)))
    lab.run(0.5)
    np.testing.assert_allclose(vector(lab.sent("imu/bias")[-1].angular_velocity), (0.01, 0.02, 0.03))
    felt = np.array([vector(message.linear_acceleration) for message in lab.sent("imu")[200:]])
    np.testing.assert_allclose(felt.mean(axis=0), (0.5, 0.5, 10.31), atol=0.06)
    assert lab.sent("imu")[-1].linear_acceleration_covariance[0] == pytest.approx(0.04)
    # An accelerometer with a sideways error measures a tilted vertical.
    assert abs(lab.sent("imu")[-1].orientation.x) == pytest.approx(0.5 * 0.5 / 9.81, rel=0.05)
    lab.ros.services["/ns/imu/calibrate"](EmptyRequest())
    np.testing.assert_allclose(vector(lab.run(0.01).sent("imu")[-1].angular_velocity), 0.0, atol=1e-4)


def test_one_noise_for_all_goes_before_those_of_each(make):
    lab = make(BOX, HectorImu, {"gaussianNoise": 0.1, "rateGaussianNoise": 5.0}, Pose((0, 0, 0.1))).run(0.05)
    assert lab.sent("imu")[-1].angular_velocity_covariance[8] == pytest.approx(0.01)


def test_satellites_say_where_it_is(make):
    # 1 degree of latitude at 45 degrees north is 111,131.7 m, of longitude 78,846.8 m (WGS 84).
    lab = make(BOX, HectorGps, {"referenceLatitude": 45, "referenceLongitude": 10, "updateRate": 4},
               Pose((111.1317, -78.8468, 100.0)))
    lab.model.set_base_twist((1.0, -2.0, 0.0), (0, 0, 0))
    lab.run(0.001)
    fix = lab.sent("fix")[-1]
    assert (fix.latitude, fix.longitude) == pytest.approx((45.001, 10.001), abs=1e-7)
    assert fix.altitude == pytest.approx(100.0, abs=1e-3) and fix.header.frame_id == "/world"
    np.testing.assert_allclose(vector(lab.sent("fix_velocity")[-1].vector)[:2], (1.0, -2.0), atol=1e-3)
    assert len(lab.run(1.0).sent("fix")) == pytest.approx(5, abs=1)


def test_the_heading_turns_the_world_on_the_globe():
    # x looks east, so y looks north.
    north, west, _ = Reference(45, 10, heading=math.pi / 2).north_west_up((3.0, 5.0, 0.0))
    assert (north, west) == pytest.approx((5.0, -3.0))


@pytest.mark.parametrize(("elements", "message_class"), [({}, Vector3Stamped),
                                                         ({"useMagneticFieldMsgs": "true"}, MagneticField)])
def test_the_field_points_north_and_down(make, elements, message_class):
    lab = make(BOX, HectorMagnetic, {"magnitude": 2, "inclination": 30, **elements}, leaning(math.pi / 2)).run(0.001)
    message = lab.sent("magnetic")[-1]
    field = vector(message.magnetic_field if message_class is MagneticField else message.vector)
    np.testing.assert_allclose(field, (2 * math.cos(math.pi / 6), -1.0, 0.0), atol=1e-4)


def test_a_sonar_measures_to_the_floor(make):
    lab = make(BOX, HectorSonar, {"topicName": "sonar", "frameId": "sonar"}, Pose((0, 0, 1.11)), sensor=RAYS)
    lab.world.set_gravity((0, 0, 0))
    lab.run(0.2)
    message = lab.sent("sonar")[-1]
    assert message.range == pytest.approx(1.0, abs=0.01) and message.header.frame_id == "sonar"
    assert (message.radiation_type, message.max_range) == (message.ULTRASOUND, 3.0)


def test_wrong_numbers_are_named(make):
    with pytest.raises(PluginError, match="<accelDrift> is '1 2', expected 1 or 3 numbers"):
        make(BOX, HectorImu, {"accelDrift": "1 2"})


def test_drift_keeps_its_deviation_whatever_the_rate():
    for dt, count in ((1.0, 40000), (10.0, 40000)):
        model = ErrorModel(1, np.random.default_rng(1), drift=0.5, frequency=0.05)
        measured = [model.measure((0.0,), dt)[0] for _ in range(count)]
        assert np.std(measured) == pytest.approx(0.5, rel=0.1)
        # After 20 s it is half forgotten, and more.
        shift = round(20.0 / dt)
        assert np.corrcoef(measured[:-shift], measured[shift:])[0, 1] == pytest.approx(math.exp(-1.0), abs=0.06)


def test_scale_offset_and_noise():
    model = ErrorModel(3, np.random.default_rng(1), offset=(1, 0, 0), noise=(0, 0, 0.2), scale=(1, 2, 1))
    measured = np.array([model.measure((1, 1, 1), 0.01) for _ in range(2000)])
    np.testing.assert_allclose(measured.mean(axis=0), (2, 2, 1), atol=0.02)
    np.testing.assert_allclose(measured.std(axis=0), (0, 0, 0.2), atol=0.02)
