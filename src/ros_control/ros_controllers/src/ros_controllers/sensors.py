# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that publish the measurements of the robot's sensors."""
from __future__ import annotations

from typing import TYPE_CHECKING

from geometry_msgs.msg import Quaternion, Vector3, Wrench, WrenchStamped
from sensor_msgs.msg import Imu

from controller_manager import Controller, ControllerError
from controller_manager.interfaces import FORCE_TORQUE_SENSOR, IMU_SENSOR
from sim_time.pace import Pace
from sim_time.stamps import stamp

if TYPE_CHECKING:
    import numpy as np

    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware


class _SensorController(Controller):
    """One topic for each sensor of the kind, of the sensor's name in the robot's namespace.

    Parameter: ``publish_rate`` [Hz], required.
    """

    interface: str
    message_class: type

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        rate = context.number("publish_rate", expected="the rate of the sensors' topics in Hz, e.g. 50")
        if rate <= 0.0:
            raise ControllerError("parameter %s is %g, expected a rate above 0 Hz"
                                  % (context.resolve("publish_rate"), rate))
        sensors = hardware.sensors.get(self.interface)
        if not sensors:
            raise ControllerError("%s needs %s, and this robot has no such sensor"
                                  % (context.namespace, self.interface))
        self.observe(self.interface)
        self._pace = Pace(rate)
        self._sensors = [(sensor, context.publisher(context.in_root(sensor_name), self.message_class))
                         for sensor_name, sensor in sensors.items()]

    def starting(self, time_s: float) -> None:
        self._pace.restart()

    def update(self, time_s: float, dt: float) -> None:
        # Read at each tick: a sensor computes differences between ticks.
        readings = [(sensor.read(), sensor, publisher) for sensor, publisher in self._sensors
                    if publisher.has_listeners]
        readings = [reading for reading in readings if reading[0] is not None]
        if readings and self._pace.take(time_s):
            for values, sensor, publisher in readings:
                message = self.message(values)
                message.header.stamp, message.header.frame_id = stamp(time_s), sensor.frame
                publisher.publish(message)

    def message(self, values: tuple[np.ndarray, ...]) -> Imu | WrenchStamped:
        """The message of a measurement."""
        raise NotImplementedError


class ImuSensorController(_SensorController):
    """sensor_msgs/Imu of each IMU."""

    interface, message_class = IMU_SENSOR, Imu

    def message(self, values: tuple[np.ndarray, ...]) -> Imu:
        turned, rate, felt = values
        return Imu(orientation=Quaternion(*turned), angular_velocity=Vector3(*rate), linear_acceleration=Vector3(*felt))


class ForceTorqueSensorController(_SensorController):
    """geometry_msgs/WrenchStamped of each force-torque sensor."""

    interface, message_class = FORCE_TORQUE_SENSOR, WrenchStamped

    def message(self, values: tuple[np.ndarray, ...]) -> WrenchStamped:
        force, torque = values
        return WrenchStamped(wrench=Wrench(Vector3(*force), Vector3(*torque)))
