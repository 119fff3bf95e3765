# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle that turns by driving its left and right wheels at different speeds."""
import numpy as np
from control_msgs.msg import JointTrajectoryControllerState

from controller_manager import VELOCITY, ControllerError
from loop_ros.reconfigure import Setting, SettingsServer
from ros_controllers.vehicle import VehicleController
from sim_time.stamps import stamp

_MULTIPLIERS = "left_wheel_radius_multiplier", "right_wheel_radius_multiplier", "wheel_separation_multiplier"
# Ranges of the settings that can be changed at run time.
_SMALLEST, _LARGEST = 0.1, 5.0
_SLOWEST_HZ, _FASTEST_HZ = 0.1, 2000.0


class DiffDriveController(VehicleController):
    """Parameters besides those of :class:`VehicleController`: ``left_wheel``, ``right_wheel``, required: a joint, or a
    list of them; ``wheel_radius`` and ``wheel_separation`` [m], by default from the description (the wheels' collision
    shapes, the joints' positions); ``wheel_separation_multiplier``, ``left_wheel_radius_multiplier``,
    ``right_wheel_radius_multiplier`` (or ``wheel_radius_multiplier`` for both), all 1;
    ``publish_wheel_joint_controller_state`` (false). dynamic_reconfigure changes the multipliers, ``publish_rate`` and
    ``enable_odom_tf``.
    """

    def _configure(self):
        context = self.context
        sides = [self._joints(side + "_wheel", "a wheel's joint, or a list of them") for side in ("left", "right")]
        if len(sides[0]) != len(sides[1]):
            raise ControllerError("%s: %d left wheels and %d right ones; expected as many"
                                  % (context.namespace, *map(len, sides)))
        self._index = [self.claim(VELOCITY, joints) for joints in sides]
        self._names = [*sides[0], *sides[1]]
        radius = self._length("wheel_radius", lambda: self._wheel_radius(sides[0][0]),
                              "a wheel's radius (its collision is neither a cylinder nor a sphere)")
        both = self._positive("wheel_radius_multiplier", 1.0, "times")
        separation = self._length("wheel_separation", lambda: self._apart(sides[0][0], sides[1][0]),
                                  "how far its wheels are apart")
        self._sizes = radius, separation
        multipliers = [self._positive(name, default, "times")
                       for name, default in zip(_MULTIPLIERS, (both, both, 1.0), strict=True)]
        self._scale(*multipliers)
        SettingsServer(context, context.namespace, [
            *(Setting(name, value, _SMALLEST, _LARGEST, "times the length of the description or of the parameter")
              for name, value in zip(_MULTIPLIERS, multipliers, strict=True)),
            Setting("publish_rate", float(self._pace.rate), _SLOWEST_HZ, _FASTEST_HZ, "rate of the odometry [Hz]"),
            Setting("enable_odom_tf", context.flag("enable_odom_tf", True), meaning="publish the transform"),
        ], self._change)
        self._state_publisher = None
        if context.flag("publish_wheel_joint_controller_state", False):
            self._state_publisher = context.publisher("wheel_joint_controller_state", JointTrajectoryControllerState)
        self._turned = [0.0, 0.0]

    def _scale(self, left, right, separation):
        self._radii = [self._sizes[0] * left, self._sizes[0] * right]
        self._separation = self._sizes[1] * separation

    def _change(self, values):
        self._scale(*(values[name] for name in _MULTIPLIERS))
        self._pace.rate = values["publish_rate"]
        self._send_transform(values["enable_odom_tf"])

    def _apart(self, left, right):
        one, other = self._place(left), self._place(right)
        return None if one is None or other is None else float(np.linalg.norm(one[:2] - other[:2]))

    def _angles(self):
        """Mean angle of the left wheels and of the right ones [rad]."""
        return [float(self.hardware.position[index].mean()) for index in self._index]

    def _note_wheels(self):
        self._turned = self._angles()

    def _driven(self):
        before, self._turned = self._turned, self._angles()
        left, right = (radius * (now - then)
                       for radius, now, then in zip(self._radii, self._turned, before, strict=True))
        return (left + right) / 2.0, (right - left) / self._separation

    def _drive(self, linear, angular):
        half = angular * self._separation / 2.0
        for index, speed, radius in zip(self._index, (linear - half, linear + half), self._radii, strict=True):
            self.hardware.command[VELOCITY][index] = speed / radius

    def _publish(self, time_s):
        super()._publish(time_s)
        if self._state_publisher is None or not self._state_publisher.has_listeners:
            return
        index = np.concatenate(self._index)
        message = JointTrajectoryControllerState(joint_names=self._names)
        message.header.stamp = stamp(time_s)
        message.actual.positions = self.hardware.position[index].tolist()
        message.actual.velocities = self.hardware.velocity[index].tolist()
        wanted = self.hardware.command[VELOCITY][index]
        message.desired.velocities = wanted.tolist()
        message.error.velocities = (wanted - self.hardware.velocity[index]).tolist()
        self._state_publisher.publish(message)
