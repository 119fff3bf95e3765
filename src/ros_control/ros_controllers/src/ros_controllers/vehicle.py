# SPDX-License-Identifier: BSD-3-Clause
"""Base of vehicle controllers: the command and its time-out, limits, odometry and tf."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Quaternion, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from command_line.options import counted
from controller_manager import Controller, ControllerError
from ros_controllers.speed_limits import read_speed_limits
from ros_controllers.wheel_odometry import WheelOdometry
from sim_time.pace import Pace
from sim_time.stamps import stamp
from urdf_model import Cylinder, Sphere

if TYPE_CHECKING:
    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware

# Of the mean of velocities [ticks]: longer than any experiment.
_LONGEST_WINDOW = 10**6


class VehicleController(Controller):
    """Base of the controllers below. Subscribes to geometry_msgs/Twist on ``cmd_vel``, of which x [m/s] and the
    rotation about z [rad/s] are used; publishes nav_msgs/Odometry on ``odom`` and the same as a transform.

    Parameters, all optional: ``publish_rate`` (50 Hz), ``cmd_vel_timeout`` (0.5 s: an older command is a stop),
    ``base_frame_id`` (base_link), ``odom_frame_id`` (odom), ``enable_odom_tf`` (true), ``open_loop`` (false; if true,
    odometry uses commands instead of wheels), ``velocity_rolling_window_size`` (10), ``pose_covariance_diagonal`` and
    ``twist_covariance_diagonal`` (six numbers each, zeros), ``publish_cmd`` (false: the limited command on
    ``cmd_vel_out``), ``allow_multiple_cmd_vel_publishers`` (true; if false, commands while several nodes publish them
    are a stop), and the limits below ``linear/x`` and ``angular/z``, see :mod:`.speed_limits`.
    """

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        self._pace = Pace(self._positive("publish_rate", 50.0, "Hz"))
        self._timeout_s = self._positive("cmd_vel_timeout", 0.5, "s")
        self._base_frame = self._frame("base_frame_id", "base_link")
        self._odom_frame = self._frame("odom_frame_id", "odom")
        self._open_loop = context.flag("open_loop", False)
        self._limits = read_speed_limits(context, "linear/x"), read_speed_limits(context, "angular/z")
        window = self._positive("velocity_rolling_window_size", 10, "ticks")
        if window > _LONGEST_WINDOW:
            self.log.warn("parameter %s is %g; %d is used" % (context.resolve("velocity_rolling_window_size"), window,
                                                              _LONGEST_WINDOW))
        self._odometry = WheelOdometry(max(1, round(min(window, _LONGEST_WINDOW))))
        self._pose_covariance = self._covariance("pose_covariance_diagonal")
        self._twist_covariance = self._covariance("twist_covariance_diagonal")
        self._configure()
        self._commands = context.subscription("cmd_vel", Twist)
        self._odom_publisher = context.publisher("odom", Odometry)
        self._tf_publisher = None
        self._send_transform(context.flag("enable_odom_tf", True))
        self._one_sender = not context.flag("allow_multiple_cmd_vel_publishers", True)
        self._out_publisher = None
        if context.flag("publish_cmd", False):
            self._out_publisher = context.publisher("cmd_vel_out", TwistStamped)
        self._halt(0.0)

    # -- of each kind of vehicle -------------------------------------------------------------------------------------

    def _configure(self):
        """Read the parameters of this kind and claim its joints."""
        raise NotImplementedError

    def _note_wheels(self):
        """Store the wheels' positions as the start of odometry."""
        raise NotImplementedError

    def _driven(self):
        """Motion by the wheels since the last call: distance [m], turn [rad]; for a kind that moves sideways, that [m],
        too."""
        raise NotImplementedError

    def _commanded(self, dt):
        """The same as :meth:`_driven` by the command of the tick before."""
        return self._last[0][0] * dt, self._last[1][0] * dt

    def _drive(self, linear, angular):
        """Command wheels (and steering) for these speeds [m/s, rad/s]."""
        raise NotImplementedError

    # -- the loop ----------------------------------------------------------------------------------------------------

    def starting(self, time_s: float) -> None:
        self._commands.take()
        self._halt(time_s)
        self._odometry.rest()
        self._pace.restart()
        self._note_wheels()

    def stopping(self, time_s: float) -> None:
        self._drive(0.0, 0.0)

    def update(self, time_s: float, dt: float) -> None:
        driven, commanded = self._driven(), self._commanded(dt)
        if dt > 0.0:
            distance, turn, *sideways = commanded if self._open_loop else driven
            self._odometry.move(distance, turn, dt, *sideways)
        self._take_commands(time_s)
        if time_s - self._commanded_s > self._timeout_s:
            self._wanted = (0.0, 0.0)
        speeds = []
        for limits, wanted, history in zip(self._limits, self._wanted, self._last, strict=True):
            last, before = history
            speed = limits.limit(wanted, last, before, dt) if dt > 0.0 else last
            history[:] = speed, last
            speeds.append(speed)
        self._drive(*speeds)
        if self._pace.take(time_s):
            self._publish(time_s)
        if self._out_publisher is not None and self._out_publisher.has_listeners:
            message = TwistStamped()
            message.header.stamp, message.header.frame_id = stamp(time_s), self._base_frame
            message.twist.linear.x, message.twist.angular.z = speeds
            self._out_publisher.publish(message)

    def _send_transform(self, wanted):
        if wanted and self._tf_publisher is None:
            self._tf_publisher = self.context.publisher("/tf", TFMessage)
        elif not wanted and self._tf_publisher is not None:
            self._tf_publisher.close()
            self._tf_publisher = None

    def _take_commands(self, time_s):
        """Take new messages of all topics of commands."""
        self._commands.handle(lambda message: self._take_command(message, time_s))

    def _take_command(self, message, time_s):
        wanted = message.linear.x, message.angular.z
        if self._one_sender and self._commands.senders() > 1:
            self.log.error_throttle(1.0, "%s: %s publish commands and allow_multiple_cmd_vel_publishers is "
                                    "false: it stops" % (self.context.resolve("cmd_vel"),
                                                         counted(self._commands.senders(), "node")))
            self._wanted = (0.0, 0.0)
            return
        if not all(map(math.isfinite, wanted)):
            self.log.warn_throttle(5.0, "%s: a velocity of %g m/s and %g rad/s is not a number; the command is ignored"
                                   % (self.context.resolve("cmd_vel"), *wanted))
            return
        self._wanted, self._commanded_s = wanted, time_s

    def _halt(self, time_s):
        self._wanted, self._commanded_s = (0.0, 0.0), time_s
        self._last = [0.0, 0.0], [0.0, 0.0]  # of each direction: the last command and the one before

    def _publish(self, time_s):
        odometry, now = self._odometry, stamp(time_s)
        turned = Quaternion(0.0, 0.0, math.sin(odometry.heading / 2.0), math.cos(odometry.heading / 2.0))
        if self._odom_publisher.has_listeners:
            message = Odometry()
            message.header.stamp, message.header.frame_id = now, self._odom_frame
            message.child_frame_id = self._base_frame
            message.pose.pose.position.x, message.pose.pose.position.y = odometry.x, odometry.y
            message.pose.pose.orientation = turned
            message.pose.covariance = self._pose_covariance
            twist = message.twist.twist
            twist.linear.x, twist.linear.y, twist.angular.z = odometry.linear, odometry.lateral, odometry.angular
            message.twist.covariance = self._twist_covariance
            self._odom_publisher.publish(message)
        if self._tf_publisher is not None and self._tf_publisher.has_listeners:
            transform = TransformStamped()
            transform.header.stamp, transform.header.frame_id = now, self._odom_frame
            transform.child_frame_id = self._base_frame
            transform.transform.translation.x, transform.transform.translation.y = odometry.x, odometry.y
            transform.transform.rotation = turned
            self._tf_publisher.publish(TFMessage([transform]))

    # -- parameters --------------------------------------------------------------------------------------------------

    def _positive(self, name, default, unit):
        value = self.context.number(name, default)
        if value <= 0.0:
            raise ControllerError("parameter %s is %g, expected a number of %s above 0"
                                  % (self.context.resolve(name), value, unit))
        return value

    def _frame(self, name, default):
        value = self.context.param(name, default)
        if not isinstance(value, str) or not value:
            raise ControllerError("parameter %s is %r, expected the name of a frame"
                                  % (self.context.resolve(name), value))
        return value.lstrip("/")

    def _covariance(self, name):
        """The 6 x 6 matrix, row by row, whose diagonal the parameter holds."""
        value = self.context.param(name, [0.0] * 6)
        if not (isinstance(value, list) and len(value) == 6
                and all(isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in value)):
            raise ControllerError("parameter %s is %r, expected six numbers: x, y, z, roll, pitch, yaw"
                                  % (self.context.resolve(name), value))
        return np.diag([float(v) for v in value]).ravel().tolist()

    def _joints(self, name, what):
        """One joint or a list of them, as a list."""
        value = self.context.required(name, what)
        return [value] if isinstance(value, str) and value else self.context.texts(name, what)

    def _length(self, name, measured, what):
        """A length [m] from a parameter, or from ``measured()`` in the description."""
        if self.context.param(name) is not None:
            return self._positive(name, 1.0, "m")
        length = measured() if self.context.robot is not None else None
        if length is None or not length > 0.0:
            raise ControllerError("parameter %s is missing, and the robot's description does not tell %s; give it in m"
                                  % (self.context.resolve(name), what))
        return length

    def _wheel_radius(self, joint):
        """Radius [m] of the wheel behind a joint by its collision shape, or None."""
        robot = self.context.robot
        if joint not in robot.joints:
            return None
        for shape in robot.links[robot.joints[joint].child].collisions:
            if isinstance(shape.geometry, (Cylinder, Sphere)):
                return shape.geometry.radius
        return None

    def _place(self, joint):
        """Position (3,) [m] of a joint in the base's frame, with all joints at zero, or None if there is no such
        joint."""
        robot, frame = self.context.robot, np.eye(4)
        while joint is not None:
            if joint not in robot.joints:
                return None
            frame = robot.joints[joint].origin @ frame
            parent = robot.joints[joint].parent
            joint = next((name for name, other in robot.joints.items() if other.child == parent), None)
            if parent == self._base_frame:
                break
        return frame[:3, 3]
