# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle that drives and steers all of its four wheels."""
from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from four_wheel_steering_msgs.msg import FourWheelSteering

from controller_manager import POSITION, VELOCITY, ControllerError
from ros_controllers.vehicle import VehicleController

# Below this speed [m/s] it stops with straight wheels, as in ros_controllers: it cannot turn on the spot.
_STANDS = 1e-3
_SAME_DIRECTION = 1e-6
_CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))  # (front or rear, left or right) of each wheel


class FourWheelSteeringController(VehicleController):
    """Commanded on ``cmd_vel``, the rear wheels steer against the front ones, so that it turns about a point beside its
    middle. A command on ``cmd_four_wheel_steering`` (four_wheel_steering_msgs/FourWheelSteering) names the angles of
    the front and of the rear axle, of at most a quarter turn, and the speed of its middle; equal angles move it
    sideways. Its rates, its acceleration and its jerk are not used. The newest command of both topics counts.

    Parameters besides those of :class:`VehicleController`: ``front_wheel``, ``rear_wheel`` (velocity interface),
    ``front_steering``, ``rear_steering`` (position interface), required: a left and a right joint each; ``wheel_base``
    [m], the distance of the axles, ``track`` [m], that of left and right wheels, and ``wheel_radius`` [m], by default
    from the description.
    """

    def _configure(self):
        wheels = [*self._pair("front_wheel"), *self._pair("rear_wheel")]
        steering = [*self._pair("front_steering"), *self._pair("rear_steering")]
        self._wheels, self._steering = self.claim(VELOCITY, wheels), self.claim(POSITION, steering)
        self._radius = self._length("wheel_radius", lambda: self._wheel_radius(wheels[0]),
                                    "the wheels' radius (their collision is neither a cylinder nor a sphere)")
        track = self._length("track", lambda: self._apart(wheels[0], wheels[1], 1), "how far left and right are apart")
        base = self._length("wheel_base", lambda: self._apart(wheels[0], wheels[2], 0), "how far its axles are apart")
        # Distance of a wheel from the axis of its steering joint.
        beside = None if self.context.robot is None else self._apart(wheels[0], steering[0], 1)
        self._beside = np.array([side * (beside or 0.0) for _, side in _CORNERS])
        self._pivots = np.array([(end * base / 2.0, side * track / 2.0) for end, side in _CORNERS])
        self._pivots[:, 1] -= self._beside
        self._turned = np.zeros(4)
        self._base = base
        self._axles = None  # angles [rad] of the front and the rear axle, if they are commanded
        self._moved = (0.0, 0.0, 0.0)  # as it is commanded: forwards, to the left [m/s], turn [rad/s]
        self._axle_commands = self.context.subscription("cmd_four_wheel_steering", FourWheelSteering)

    def starting(self, time_s: float) -> None:
        self._axle_commands.take()
        self._axles = None
        super().starting(time_s)

    def stopping(self, time_s: float) -> None:
        self._axles = None
        super().stopping(time_s)

    def _take_commands(self, time_s):
        super()._take_commands(time_s)
        self._axle_commands.handle(lambda message: self._take_axles(message, time_s))
        if time_s - self._commanded_s > self._timeout_s:
            self._axles = None

    def _take_command(self, message, time_s):
        super()._take_command(message, time_s)
        if self._commanded_s == time_s:
            self._axles = None

    def _take_axles(self, message, time_s):
        wanted = message.speed, message.front_steering_angle, message.rear_steering_angle
        if not all(map(math.isfinite, wanted)):
            self.log.warn_throttle(5.0, "%s: a speed of %g m/s with angles of %g and %g rad is not a number; the "
                                   "command is ignored" % (self.context.resolve("cmd_four_wheel_steering"), *wanted))
            return
        self._axles = tuple(min(max(angle, -math.pi / 2.0), math.pi / 2.0) for angle in wanted[1:])
        self._wanted, self._commanded_s = (message.speed, 0.0), time_s

    def _pair(self, name):
        joints = self._joints(name, "the left and the right joint")
        if len(joints) != 2:
            raise ControllerError("the number of joints in parameter %s is %d, expected a left and a right one"
                                  % (self.context.resolve(name), len(joints)))
        return joints

    def _apart(self, one, other, axis):
        place, beside = self._place(one), self._place(other)
        return None if place is None or beside is None else abs(float(place[axis] - beside[axis]))

    def _note_wheels(self):
        self._turned = self.hardware.position[self._wheels].copy()

    def _driven(self):
        before, self._turned = self._turned, self.hardware.position[self._wheels].copy()
        rolled = self._radius * (self._turned - before)
        angles = self.hardware.position[self._steering]
        along: npt.NDArray[np.float64] = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        places = self._pivots + self._beside[:, None] * np.stack([-along[:, 1], along[:, 0]], axis=1)
        # Each wheel gives two equations: its rolled distance, and no sideways slip. The motion (x, y, turn) is the
        # least-squares fit of the eight equations.
        rows = np.zeros((8, 3))
        rows[0::2, 0], rows[1::2, 1] = 1.0, 1.0
        rows[0::2, 2], rows[1::2, 2] = -places[:, 1], places[:, 0]
        motion = np.linalg.lstsq(rows, (rolled[:, None] * along).ravel(), rcond=None)[0]
        return float(motion[0]), float(motion[2]), float(motion[1])

    def _commanded(self, dt):
        x, y, turn = self._moved
        return x * dt, turn * dt, y * dt

    def _drive(self, linear, angular):
        speeds, angles = np.zeros(4), np.zeros(4)
        if self._axles is not None:
            front, rear = self._axles
            motion = _along(front, rear, self._base)
            angles, rates = self._wheels_for(motion)  # at rest the wheels steer already
            speeds = linear * rates
            self._moved = tuple(linear * part for part in motion)
        elif abs(linear) > _STANDS:
            self._moved = linear, 0.0, angular
            angles, speeds = self._wheels_for(self._moved)
        else:
            self._moved = 0.0, 0.0, 0.0
        self.hardware.command[VELOCITY][self._wheels] = speeds
        self.hardware.command[POSITION][self._steering] = angles

    def _wheels_for(self, motion):
        """Angles [rad] and rates [rad/s] (4,) of the wheels for a motion: x, y [m/s] of the middle, turn [rad/s]."""
        linear, lateral, angular = motion
        # Of each steering joint; the wheel rolls forwards or backwards along it.
        x, y = linear - angular * self._pivots[:, 1], lateral + angular * self._pivots[:, 0]
        sign = math.copysign(1.0, linear)
        angles = np.arctan2(sign * y, np.maximum(sign * x, 0.0))
        return angles, (sign * np.hypot(x, y) - angular * self._beside) / self._radius


def _along(front, rear, base):
    """The motion (x, y [m/s], turn [rad/s]) of a vehicle whose axles, ``base`` [m] apart, are steered to ``front`` and
    ``rear`` [rad] and whose middle moves at 1 m/s; zeros where it would turn on the spot."""
    x, y = math.cos(front) * math.cos(rear), math.sin(front + rear) / 2.0
    speed = math.hypot(x, y)
    if speed < _SAME_DIRECTION:
        # Both axles are across.
        return (0.0, math.sin(front), 0.0) if front * rear > 0.0 else (0.0, 0.0, 0.0)
    return x / speed, y / speed, math.sin(front - rear) / base / speed
