# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle whose front wheel drives and steers."""
from __future__ import annotations

import math
from typing import overload

import numpy as np

from gazebo_plugins.drives import DiffDrive

_NAMES = {"leftJoint": "encoderWheelLeftJoint", "rightJoint": "encoderWheelRightJoint",
          "wheelSeparation": "encoderWheelSeparation", "wheelDiameter": "encoderWheelDiameter"}
_DEFAULTS = {"leftJoint": "left_wheel_joint", "rightJoint": "right_wheel_joint", "wheelSeparation": "0.5",
             "robotBaseFrame": "base_link"}


class Tricycle(DiffDrive):
    """``libgazebo_ros_tricycle_drive.so``. On ``cmd_vel``, ``linear.x`` is the speed of the front wheel's rim [m/s] and
    ``angular.z`` its steering angle [rad], of at most a quarter turn.

    Elements besides those of :class:`gazebo_plugins.drives.Drive`: ``steeringJoint`` (front_steering_joint),
    ``actuatedWheelJoint`` (front_wheel_joint), ``actuatedWheelDiameter`` (0.15 m), ``encoderWheelLeftJoint``
    (left_wheel_joint), ``encoderWheelRightJoint`` (right_wheel_joint), ``encoderWheelSeparation`` (0.5 m),
    ``encoderWheelDiameter`` (0.15 m), ``wheelTorque`` (5 Nm at most, of both motors), ``wheelAcceleration`` (0: any; of
    the front wheel [rad/s2]), ``wheelDeceleration`` (as the acceleration), ``steeringSpeed`` (0: any [rad/s]),
    ``odometrySource`` (world; encoder), ``publishWheelJointState``, ``publishWheelTF`` (false). The wheels'
    tolerances have no effect.
    """

    @overload
    def text(self, tag: str, default: str) -> str: ...

    @overload
    def text(self, tag: str, default: None = None) -> str | None: ...

    def text(self, tag: str, default: str | None = None) -> str | None:
        return super().text(_NAMES.get(tag, tag), _DEFAULTS.get(tag, default))

    def configure(self) -> None:
        super().configure()
        names = [self.joint("steeringJoint", "front_steering_joint"),
                 self.joint("actuatedWheelJoint", "front_wheel_joint")]
        front = self.model.index(names)
        self._steering, self._driven = front[:1], front[1:]
        self._strength = self._torque[:1]
        self._front_radius = self.positive("actuatedWheelDiameter", 0.15) / 2.0
        self._slowing = self.number("wheelDeceleration", self.acceleration)
        self._steering_speed = self.number("steeringSpeed", 0.0)
        self._rate, self._angle = 0.0, 0.0  # as they are commanded [rad/s, rad]
        # Files name the rear wheels either way round: in Gazebo odometry turns to the wrong side with one of them.
        left, right = (self._beside(joints[0]) for joints in self.sides())
        self._side = math.copysign(1.0, left - right)
        if self._wheels is not None:
            self._both = np.concatenate([front, self._both])
        self._wheel_names = [*names, *self._wheel_names]

    def drive(self, x: float, y: float, turn: float, dt: float) -> None:
        wanted = x / self._front_radius
        most = self.acceleration if abs(wanted) > abs(self._rate) else self._slowing
        self._rate = _towards(self._rate, wanted, most * dt)
        angle = min(max(turn, -math.pi / 2.0), math.pi / 2.0)
        self._angle = _towards(self._angle, angle, self._steering_speed * dt)
        self.model.drive_velocity(self._driven, np.array([self._rate]), self._strength)
        self.model.drive_position(self._steering, np.array([self._angle]), self._strength)

    def turn(self, left: float, right: float, dt: float) -> float:
        return self._side * super().turn(left, right, dt)

    def reset(self) -> None:
        super().reset()
        self._rate, self._angle = 0.0, 0.0

    def _beside(self, joint: str) -> float:
        """How far left of the middle [m] a joint's wheel is."""
        place = self.model.link_pose(self.model.robot.joints[joint].child).position
        base = self.model.base_pose()
        return float(base.matrix()[:3, 1] @ (np.asarray(place) - np.asarray(base.position)))


def _towards(value: float, target: float, most: float) -> float:
    """``value``, nearer to ``target`` by at most ``most``; 0 stands for any."""
    return target if most == 0.0 else value + min(max(target - value, -most), most)
