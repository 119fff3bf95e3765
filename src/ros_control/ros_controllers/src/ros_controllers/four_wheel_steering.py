# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle that drives and steers all of its four wheels."""
import math

import numpy as np

from controller_manager import POSITION, VELOCITY, ControllerError
from ros_controllers.vehicle import VehicleController

# Below this speed [m/s] it stops with straight wheels, as in ros_controllers: it cannot turn on the spot.
_STANDS = 1e-3
_CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))  # (front or rear, left or right) of each wheel


class FourWheelSteeringController(VehicleController):
    """The rear wheels steer against the front ones, so that it turns about a point beside its middle.

    Parameters besides those of :class:`VehicleController`: ``front_wheel``, ``rear_wheel`` (velocity interface),
    ``front_steering``, ``rear_steering`` (position interface), required: a left and a right joint each; ``wheel_base``
    [m], the distance of the axles, ``track`` [m], that of left and right wheels, and ``wheel_radius`` [m], by default
    from the description. Only the topic ``cmd_vel`` is supported, not ``cmd_four_wheel_steering``.
    """

    def _configure(self):
        wheels = [*self._pair("front_wheel"), *self._pair("rear_wheel")]
        steering = [*self._pair("front_steering"), *self._pair("rear_steering")]
        self._wheels, self._steering = self.claim(VELOCITY, wheels), self.claim(POSITION, steering)
        self._radius = self._length("wheel_radius", lambda: self._wheel_radius(wheels[0]),
                                    "the wheels' radius (their collision is no cylinder and no sphere)")
        track = self._length("track", lambda: self._apart(wheels[0], wheels[1], 1), "how far left and right are apart")
        base = self._length("wheel_base", lambda: self._apart(wheels[0], wheels[2], 0), "how far its axles are apart")
        # Distance of a wheel from the axis of its steering joint.
        beside = None if self.context.robot is None else self._apart(wheels[0], steering[0], 1)
        self._beside = np.array([side * (beside or 0.0) for _, side in _CORNERS])
        self._pivots = np.array([(end * base / 2.0, side * track / 2.0) for end, side in _CORNERS])
        self._pivots[:, 1] -= self._beside
        self._turned = np.zeros(4)

    def _pair(self, name):
        joints = self._joints(name, "the left and the right joint")
        if len(joints) != 2:
            raise ControllerError("parameter %s has %d joints, expected a left and a right one"
                                  % (self.context.resolve(name), len(joints)))
        return joints

    def _apart(self, one, other, axis):
        places = self._place(one), self._place(other)
        return None if any(place is None for place in places) else abs(float(places[0][axis] - places[1][axis]))

    def _note_wheels(self):
        self._turned = self.hardware.position[self._wheels].copy()

    def _driven(self):
        before, self._turned = self._turned, self.hardware.position[self._wheels].copy()
        rolled = self._radius * (self._turned - before)
        angles = self.hardware.position[self._steering]
        along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        places = self._pivots + self._beside[:, None] * np.stack([-along[:, 1], along[:, 0]], axis=1)
        # Each wheel gives two equations: its rolled distance, and no sideways slip. The motion (x, y, turn) is the
        # least-squares fit of the eight equations.
        rows = np.zeros((8, 3))
        rows[0::2, 0], rows[1::2, 1] = 1.0, 1.0
        rows[0::2, 2], rows[1::2, 2] = -places[:, 1], places[:, 0]
        motion = np.linalg.lstsq(rows, (rolled[:, None] * along).ravel(), rcond=None)[0]
        return float(motion[0]), float(motion[2])

    def _drive(self, linear, angular):
        speeds, angles = np.zeros(4), np.zeros(4)
        if abs(linear) > _STANDS:
            # Target of each steering joint; the wheel rolls forwards or backwards along it.
            x, y = linear - angular * self._pivots[:, 1], angular * self._pivots[:, 0]
            sign = math.copysign(1.0, linear)
            angles = np.arctan2(sign * y, np.maximum(sign * x, 0.0))
            speeds = (sign * np.hypot(x, y) - angular * self._beside) / self._radius
        self.hardware.command[VELOCITY][self._wheels] = speeds
        self.hardware.command[POSITION][self._steering] = angles
