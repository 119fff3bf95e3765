# SPDX-License-Identifier: BSD-3-Clause
"""The base of TurtleBot 2."""
from __future__ import annotations

from typing import TYPE_CHECKING, overload

import numpy as np
from geometry_msgs.msg import Quaternion, Vector3
from sensor_msgs.msg import Imu
from std_msgs.msg import Empty

from gazebo_plugins.drives import DiffDrive
from ros_controllers.wheel_odometry import WheelOdometry
from sim_time.stamps import stamp

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

_NAMES = {"leftJoint": "left_wheel_joint_name", "rightJoint": "right_wheel_joint_name",
          "wheelSeparation": "wheel_separation", "wheelDiameter": "wheel_diameter", "publishOdomTF": "publish_tf"}
_FIXED = {"odometrySource": "encoder", "publishWheelJointState": "true"}


class Kobuki(DiffDrive):
    """``libgazebo_ros_kobuki.so``. Elements: ``left_wheel_joint_name``, ``right_wheel_joint_name``,
    ``wheel_separation`` [m], ``wheel_diameter`` [m], ``torque`` [Nm], ``velocity_command_timeout`` (0.6 s; an older
    command stops it), ``publish_tf`` (false).

    Below the parameter ``base_prefix`` (mobile_base): ``commands/velocity``, ``commands/reset_odometry`` and
    ``sensors/imu_data``. Odometry counts the wheels' way and the gyro's turn. What needs kobuki_msgs is left out.
    """

    rate = 50.0
    torque_tag = "torque"

    def __init__(self, context: PluginContext) -> None:
        self._prefix = context.param("base_prefix", "mobile_base")
        super().__init__(context)
        self._resets = context.subscription(self._prefix + "/commands/reset_odometry", Empty)
        self._imu = context.publisher(self._prefix + "/sensors/imu_data", Imu)
        self._last = None  # (time, linear velocity in the world)
        context.log.warn("%s: bumper, cliff and wheel drop events, sensors/core and motor_power (kobuki_msgs) are not "
                         "served" % self.what)

    @overload
    def text(self, tag: str, default: str) -> str: ...

    @overload
    def text(self, tag: str, default: None = None) -> str | None: ...

    def text(self, tag: str, default: str | None = None) -> str | None:
        if tag == "commandTopic":
            return self._prefix + "/commands/velocity"
        if tag == "publishOdomTF":
            default = "false"
        return _FIXED.get(tag) or super().text(_NAMES.get(tag, tag), default)

    def configure(self) -> None:
        super().configure()
        self.timeout_s = self.number("velocity_command_timeout", 0.6)

    def update(self, time_s: float, dt: float) -> None:
        self._resets.handle(self._reset_odometry)
        super().update(time_s, dt)

    def _reset_odometry(self, message: Empty) -> None:
        self._counted = WheelOdometry()

    def turn(self, left: float, right: float, dt: float) -> float:
        return float(self._gyro()[2]) * dt

    def also_publish(self, time_s: float) -> None:
        super().also_publish(time_s)
        if not self._imu.has_listeners:
            self._last = None
            return
        axes = self.model.base_pose().matrix()[:3, :3]
        linear = np.asarray(self.model.base_twist()[0])
        last, self._last = self._last, (time_s, linear)
        if last is None or time_s <= last[0]:
            return
        felt = axes.T @ ((linear - last[1]) / (time_s - last[0]) - np.asarray(self.context.world.gravity))
        message = Imu(angular_velocity=Vector3(*self._gyro()), linear_acceleration=Vector3(*felt))
        message.orientation = Quaternion(*self.model.base_pose().quaternion)
        message.header.stamp, message.header.frame_id = stamp(time_s), "base_link"
        self._imu.publish(message)

    def reset(self) -> None:
        super().reset()
        self._last = None

    def _gyro(self) -> np.ndarray:
        return self.model.base_pose().matrix()[:3, :3].T @ np.asarray(self.model.base_twist()[1])
