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


@pytest.mark.parametrize(("elements", "frame", "force"), [
    ("", "tool", (0, 0.5 * 9.81, 0)), ("<frame>child</frame>", "tool", (0, 0.5 * 9.81, 0)),
    ("<frame>parent</frame>", "boom", (0, 0, -0.5 * 9.81)), ("<frame>sensor</frame>", "tool", (0, 0, 0.5 * 9.81)),
    ("<measure_direction>parent_to_child</measure_direction>", "tool", (0, -0.5 * 9.81, 0))])
def test_sensors_measure_in_the_axes_that_they_name(elements, frame, force):
    # The tool is turned by -90 degrees about x: its y points down. So the sensor's by 90: its z is the tool's y.
    text = ARM.replace('<origin xyz="0.6 0 0"/>', '<origin xyz="0.6 0 0" rpy="-1.5707963267948966 0 0"/>').replace(
        'type="force_torque"/>', 'type="force_torque"><pose>0 0 0 -1.5707963267948966 0 0</pose><force_torque>%s'
        "</force_torque></sensor>" % elements).replace(
        'type="imu"/>', 'type="imu"><pose>0 0 0 3.141592653589793 0 0</pose></sensor>')
    world = World(time_step_s=0.001)
    sensors = simulated_sensors(world, world.spawn(parse_urdf(text), "arm", Pose((0, 0, 1))))
    imu, wrist = sensors[IMU_SENSOR]["imu"], sensors[FORCE_TORQUE_SENSOR]["wrist_ft"]
    for _ in range(3):
        felt, wrench = imu.read(), wrist.read()
        world.step()
    assert wrist.frame == frame
    np.testing.assert_allclose(wrench[0], force, atol=1e-3)
    np.testing.assert_allclose(felt[2], (0, 9.81, 0), atol=1e-3)
    world.close()
