# SPDX-License-Identifier: BSD-3-Clause
"""Sensors are published by their names, at the requested rate."""
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from controller_manager import POSITION, ControllerError, ControllerTable
from controller_manager.interfaces import FORCE_TORQUE_SENSOR, IMU_SENSOR
from controller_manager.testing import FakeHardware, fake_context

DT = 0.01
TABLE = ControllerTable(yaml.safe_load((Path(__file__).parents[2] / "config" / "controllers.yaml").read_text()))
IMU, FORCE = "imu_sensor_controller/ImuSensorController", "force_torque_sensor_controller/ForceTorqueSensorController"
MEASURED = {IMU_SENSOR: ((0.0, 0.0, 0.0, 1.0), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)),
            FORCE_TORQUE_SENSOR: ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))}


def robot(interface, names=("left", "right")):
    hardware = FakeHardware({"joint": (POSITION,)})
    hardware.sensors = {interface: {name: SimpleNamespace(frame=name + "_link", read=lambda: MEASURED[interface])
                                    for name in names}}
    return hardware


@pytest.mark.parametrize(("kind", "interface"), [(IMU, IMU_SENSOR), (FORCE, FORCE_TORQUE_SENSOR)])
def test_each_sensor_has_its_topic(kind, interface):
    context, ros = fake_context("sensors", {"publish_rate": 20})
    controller = TABLE.find(kind)("sensors", robot(interface), context)
    assert list(controller.claims) == [interface] and not controller.claims[interface]
    controller.starting(0.0)
    for tick in range(1, 101):
        controller.update(tick * DT, DT)
    for name in ("left", "right"):
        messages = ros.publishers["/robot/" + name].messages
        assert len(messages) == pytest.approx(20, abs=1) and messages[-1].header.frame_id == name + "_link"
        last = messages[-1]
        first, second = ((last.angular_velocity, last.linear_acceleration) if kind == IMU
                         else (last.wrench.force, last.wrench.torque))
        assert (first.x, first.y, first.z, second.x, second.y, second.z) == (1, 2, 3, 4, 5, 6)


def test_what_a_sensor_does_not_know_yet_is_not_published():
    context, ros = fake_context("sensors", {"publish_rate": 20})
    hardware = robot(IMU_SENSOR, ["imu"])
    hardware.sensors[IMU_SENSOR]["imu"].read = lambda: None
    controller = TABLE.find(IMU)("sensors", hardware, context)
    controller.starting(0.0)
    controller.update(DT, DT)
    assert not ros.publishers["/robot/imu"].messages


@pytest.mark.parametrize(("parameters", "interface", "text"), [
    ({}, IMU_SENSOR, "publish_rate"), ({"publish_rate": 0}, IMU_SENSOR, "expected a rate above 0"),
    ({"publish_rate": 20}, FORCE_TORQUE_SENSOR, "ImuSensorInterface, and this robot has no such sensor")])
def test_what_cannot_be_served_is_refused(parameters, interface, text):
    context, _ = fake_context("sensors", parameters)
    with pytest.raises(ControllerError, match=text):
        TABLE.find(IMU)("sensors", robot(interface), context)
