# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle with front steering and rear drive."""
import math

from controller_manager import POSITION, VELOCITY
from ros_controllers.vehicle import VehicleController


class AckermannSteeringController(VehicleController):
    """One wheel drives, one joint steers, as on a bicycle; a car's other wheels roll passively.

    As in ros_controllers, the rotation about z of ``cmd_vel`` is the steering angle [rad], and the limits below
    ``angular/z`` apply to that angle.

    Parameters besides those of :class:`VehicleController`: ``rear_wheel`` (velocity interface) and ``front_steer``
    (position interface), joints, by default rear_wheel_joint and front_steer_joint; ``wheel_separation_h`` [m], the
    distance of front and rear axle, and ``wheel_radius`` [m], by default from the description;
    ``wheel_separation_h_multiplier``, ``wheel_radius_multiplier`` and ``steer_pos_multiplier`` (1).
    """

    def _configure(self):
        rear, front = (self.context.param(name, name + "_joint") for name in ("rear_wheel", "front_steer"))
        self._wheel, = self.claim(VELOCITY, [rear])
        self._steer, = self.claim(POSITION, [front])
        self._radius = (self._length("wheel_radius", lambda: self._wheel_radius(rear),
                                     "the wheel's radius (its collision is neither a cylinder nor a sphere)")
                        * self._positive("wheel_radius_multiplier", 1.0, "times"))
        self._base = (self._length("wheel_separation_h", lambda: self._apart(front, rear),
                                   "how far its axles are apart")
                      * self._positive("wheel_separation_h_multiplier", 1.0, "times"))
        self._steering = self._positive("steer_pos_multiplier", 1.0, "times")
        self._turned = 0.0

    def _apart(self, front, rear):
        one, other = self._place(front), self._place(rear)
        return None if one is None or other is None else abs(float(one[0] - other[0]))

    def _note_wheels(self):
        self._turned = float(self.hardware.position[self._wheel])

    def _driven(self):
        before, self._turned = self._turned, float(self.hardware.position[self._wheel])
        distance = self._radius * (self._turned - before)
        return distance, self._turn(distance, float(self.hardware.position[self._steer]))

    def _commanded(self, dt):
        distance = self._last[0][0] * dt
        return distance, self._turn(distance, self._last[1][0])

    def _turn(self, distance, angle):
        """Change of heading [rad] over ``distance`` [m] at steering angle ``angle`` [rad]: the bicycle model."""
        return distance * math.tan(self._steering * angle) / self._base

    def _drive(self, linear, angular):
        self.hardware.command[VELOCITY][self._wheel] = linear / self._radius
        self.hardware.command[POSITION][self._steer] = angular
