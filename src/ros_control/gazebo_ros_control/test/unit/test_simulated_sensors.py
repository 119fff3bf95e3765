# SPDX-License-Identifier: BSD-3-Clause
"""Sensors of a description as hardware, with known measurements."""
import numpy as np
import pytest

from bullet_sim import Pose, World
from controller_manager.interfaces import FORCE_TORQUE_SENSOR, IMU_SENSOR
from gazebo_ros_control.sensors import simulated_sensors
from urdf_model import parse_urdf

ARM = """<robot name="arm"><link name="world"/><link name="boom"><inertial><origin xyz="0.3 0 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link><link name="tool"><inertial><mass value="0.5"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
<joint name="turn" type="continuous"><parent link="world"/><child link="boom"/><axis xyz="0 0 1"/></joint>
<joint name="mount" type="fixed"><parent link="boom"/><child link="tool"/><origin xyz="0.6 0 0"/></joint>
<gazebo reference="tool"><sensor name="imu" type="imu"/></gazebo>
<gazebo reference="mount"><sensor name="wrist_ft" type="force_torque"/></gazebo>
<gazebo reference="turn"><sensor name="camera" type="camera"/></gazebo></robot>"""


@pytest.fixture
def lab():
    world = World(time_step_s=0.001)
    model = world.spawn(parse_urdf(ARM), "arm", Pose((0, 0, 1)))
    yield world, model, simulated_sensors(world, model)
    world.close()


def test_sensors_have_the_names_of_the_description(lab):
    sensors = lab[2]
    assert list(sensors[IMU_SENSOR]) == ["imu"] and list(sensors[FORCE_TORQUE_SENSOR]) == ["wrist_ft"]
    assert sensors[IMU_SENSOR]["imu"].frame == sensors[FORCE_TORQUE_SENSOR]["wrist_ft"].frame == "tool"


def test_a_turning_arm_feels_weight_and_pull(lab):
    world, model, sensors = lab
    imu, wrist = sensors[IMU_SENSOR]["imu"], sensors[FORCE_TORQUE_SENSOR]["wrist_ft"]
    assert imu.read() is None and wrist.read() is None
    for _ in range(500):
        model.drive_velocity(np.arange(1), np.array([2.0]), np.array([1e3]))
        world.step()
        felt, wrench = imu.read(), wrist.read()
    np.testing.assert_allclose(felt[1], (0, 0, 2.0), atol=1e-3)
    # To the middle by r w2, and gravity upwards.
    np.testing.assert_allclose(felt[2], (-0.6 * 4.0, 0, 9.81), atol=0.02)
    np.testing.assert_allclose(wrench[0], (0.5 * 0.6 * 4.0, 0, -0.5 * 9.81), atol=0.02)
    world.step()
    world.step()
    # Two steps since the last call: no difference is computed.
    assert imu.read() is None and wrist.read() is None
