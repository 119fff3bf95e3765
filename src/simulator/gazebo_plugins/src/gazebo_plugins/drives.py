# SPDX-License-Identifier: BSD-3-Clause
"""Vehicles that follow ``cmd_vel``: on two wheels, on four, or sliding."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, overload

import numpy as np
from geometry_msgs.msg import Quaternion, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.transforms import quaternion, transform_msg
from gazebo_ros.urdf_extras import unscoped
from ros_controllers.wheel_odometry import WheelOdometry
from sim_time.pace import Pace
from sim_time.stamps import stamp

if TYPE_CHECKING:
    import genpy
    from geometry_msgs.msg import TransformStamped

    from gazebo_ros.model_plugin import PluginContext

# Variances of x, y, z [m2], roll, pitch, yaw [rad2]: large for the directions that plane odometry does not measure.
_UNKNOWN = 1e12
_VARIANCES = (1e-5, 1e-5, _UNKNOWN, _UNKNOWN, _UNKNOWN, 1e-3)


class Drive(ModelPlugin):
    """Base of the classes below. Elements, with their defaults: ``commandTopic`` (cmd_vel), ``odometryTopic`` (odom),
    ``odometryFrame`` (odom), ``robotBaseFrame`` (base_footprint), ``updateRate`` or ``odometryRate`` [Hz] (``rate``).
    A command holds until the next one, or until the timeout of a kind that has one.
    """

    rate = 100.0
    rate_tag = "updateRate"
    tf_tag = "publishOdomTF"
    variances = _VARIANCES

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self.what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        self.model = context.model
        rate = self.number(self.rate_tag, self.rate)
        self._pace = Pace(max(0.0, rate))
        self._odometry_frame = context.frame(self.text("odometryFrame", "odom"))
        self._base_frame = context.frame(self.text("robotBaseFrame", "base_footprint"))
        self._wanted, self._commanded_at = (0.0, 0.0, 0.0), 0.0
        #: How long a command holds [s].
        self.timeout_s = math.inf
        self.configure()
        self._commands = context.subscription(self.text("commandTopic", "cmd_vel"), Twist)
        publishes = self.flag("publishTf", True)
        self._odometry = context.publisher(self.text("odometryTopic", "odom"), Odometry) if publishes else None
        self._tf = context.publisher("/tf", TFMessage) if publishes and self.flag(self.tf_tag, True) else None

    # -- of each kind ------------------------------------------------------------------------------------------------

    def configure(self) -> None:
        """Read the elements of this kind. Raises ``PluginError``."""

    def drive(self, x: float, y: float, turn: float, dt: float) -> None:
        """Before a step: drive at ``x``, ``y`` [m/s] in the model's axes, and turn [rad/s]."""
        raise NotImplementedError

    def moved(self, time_s: float, dt: float) -> None:
        """After a step, for a kind that integrates its odometry."""

    def where(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(pose (4, 4), linear velocity (3,), angular velocity (3,)), the velocities in the model's axes."""
        pose = self.model.base_pose().matrix()
        linear, angular = (pose[:3, :3].T @ np.asarray(part) for part in self.model.base_twist())
        return pose, linear, angular

    # -- the loop ----------------------------------------------------------------------------------------------------

    def update(self, time_s: float, dt: float) -> None:
        self._now = time_s
        self._commands.handle(self._take)
        if time_s - self._commanded_at > self.timeout_s:
            self._wanted = (0.0, 0.0, 0.0)
        self.drive(*self._wanted, dt)

    def _take(self, message: Twist) -> None:
        wanted = (message.linear.x, message.linear.y, message.angular.z)
        if all(map(math.isfinite, wanted)):
            self._wanted, self._commanded_at = wanted, self._now
        else:
            self.context.log.warn_throttle(5.0, "%s: a command of %g, %g m/s and %g rad/s is not a number and ignored"
                                           % (self.what, *wanted))

    def publish(self, time_s: float) -> None:
        self.moved(time_s, self.context.world.time_step_s)
        if not self._pace.take(time_s):
            return
        odometry, tf = self._odometry, self._tf
        if odometry is not None and not odometry.has_listeners:
            odometry = None
        if tf is not None and not tf.has_listeners:
            tf = None
        if odometry is not None or tf is not None:
            pose, linear, angular = self.where()
            if odometry is not None:
                odometry.publish(self._message(stamp(time_s), pose, linear, angular))
            if tf is not None:
                tf.publish(TFMessage([transform_msg(time_s, self._odometry_frame, self._base_frame, pose)]))
        self.also_publish(time_s)

    def also_publish(self, time_s: float) -> None:
        """Called at the same rate, for a kind with further topics."""

    def reset(self) -> None:
        self._wanted, self._commanded_at = (0.0, 0.0, 0.0), 0.0
        self._commands.take()
        self._pace.restart()

    def _message(self, now: genpy.Time, pose: np.ndarray, linear: np.ndarray, angular: np.ndarray) -> Odometry:
        message = Odometry(child_frame_id=self._base_frame)
        message.header.stamp, message.header.frame_id = now, self._odometry_frame
        position, twist = message.pose.pose.position, message.twist.twist
        position.x, position.y, position.z = pose[:3, 3].tolist()
        message.pose.pose.orientation = Quaternion(*quaternion(pose))
        twist.linear.x, twist.linear.y, twist.linear.z = linear.tolist()
        twist.angular.x, twist.angular.y, twist.angular.z = angular.tolist()
        message.pose.covariance = message.twist.covariance = np.diag(self.variances).ravel().tolist()
        return message

    # -- elements ----------------------------------------------------------------------------------------------------

    @overload
    def text(self, tag: str, default: str) -> str: ...

    @overload
    def text(self, tag: str, default: None = None) -> str | None: ...

    def text(self, tag: str, default: str | None = None) -> str | None:
        """The text of an element, or ``default``. Kinds whose elements have other names override it."""
        return self.context.element_text(tag, default)

    def number(self, tag: str, default: float) -> float:
        """A finite number, 0 or more."""
        text = self.text(tag)
        try:
            value = default if text is None else float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value >= 0.0):
            raise PluginError("%s: <%s> is '%s', expected a number of 0 or more" % (self.what, tag, text))
        return value

    def positive(self, tag: str, default: float) -> float:
        """A finite number above 0."""
        value = self.number(tag, default)
        if value == 0.0:
            raise PluginError("%s: <%s> is 0, expected a number above 0" % (self.what, tag))
        return value

    def flag(self, tag: str, default: bool) -> bool:
        """true, false, 1 or 0."""
        text = self.text(tag)
        if text is None:
            return default
        known = {"true": True, "1": True, "false": False, "0": False}
        if text.lower() not in known:
            raise PluginError("%s: <%s> is '%s', expected true or false" % (self.what, tag, text))
        return known[text.lower()]

    def joint(self, tag: str, default: str) -> str:
        """The name of one of the model's joints."""
        name = unscoped(self.model.name, self.text(tag, default))
        if name not in self.model.joint_names:
            raise PluginError("%s: <%s> is '%s', expected one of the joints %s"
                              % (self.what, tag, name, ", ".join(self.model.joint_names) or "(there are none)"))
        return name


class _Wheels(Drive):
    """Wheels on two sides."""

    #: The element with the torque of a wheel.
    torque_tag: str
    #: Of the rims, at most [m/s^2]; 0: any.
    acceleration: float
    _separation: float  # of the sides [m]
    _radius: float  # of a wheel [m]

    def sides(self) -> tuple[list[str], list[str]]:
        """(joints of the left wheels, joints of the right ones), names."""
        raise NotImplementedError

    def configure(self) -> None:
        left, right = self.sides()
        self._left, self._right = self.model.index(left), self.model.index(right)
        self._both = np.concatenate([self._left, self._right])
        self._torque = np.full(len(self._both), self.positive(self.torque_tag, 5.0))
        self._speeds = np.zeros(2)  # of the left and the right rims, as they are commanded [m/s]

    def rims(self, x: float, turn: float) -> np.ndarray:
        """Target speeds of the rims (2,) [m/s], left and right."""
        half = turn * self._separation / 2.0
        return np.array([x - half, x + half])

    def drive(self, x: float, y: float, turn: float, dt: float) -> None:
        wanted = self.rims(x, turn)
        change = self.acceleration * dt if self.acceleration else math.inf
        self._speeds = np.clip(wanted, self._speeds - change, self._speeds + change)
        rates = np.repeat(self._speeds / self._radius, (len(self._left), len(self._right)))
        self.model.drive_velocity(self._both, rates, self._torque)

    def reset(self) -> None:
        super().reset()
        self._speeds = np.zeros(2)


class DiffDrive(_Wheels):
    """``libgazebo_ros_diff_drive.so``. Elements besides those of :class:`Drive`: ``leftJoint`` (left_joint),
    ``rightJoint`` (right_joint), ``wheelSeparation`` (0.34 m), ``wheelDiameter`` (0.15 m), ``wheelTorque`` (5 Nm at
    most), ``wheelAcceleration`` (0: any; of the rim [m/s2]), ``odometrySource`` (world; encoder),
    ``publishWheelJointState`` (false: the wheels on ``joint_states``),
    ``publishWheelTF`` (false: the frames of the wheels on ``/tf``), ``publishTf`` (true; false: neither odometry nor
    its transform, as in Gazebo).
    """

    torque_tag = "wheelTorque"
    named_after_model = True

    def sides(self) -> tuple[list[str], list[str]]:
        return [self.joint("leftJoint", "left_joint")], [self.joint("rightJoint", "right_joint")]

    def configure(self) -> None:
        super().configure()
        self._separation = self.positive("wheelSeparation", 0.34)
        self._radius = self.positive("wheelDiameter", 0.15) / 2.0
        self.acceleration = self.number("wheelAcceleration", 0.0)
        source = self.text("odometrySource", "world").lower()
        if source not in ("world", "encoder", "0", "1"):
            raise PluginError("%s: <odometrySource> is '%s', expected world or encoder" % (self.what, source))
        self._counted = WheelOdometry() if source in ("encoder", "0") else None
        self._turned = self._angles()
        self._wheel_names = [self.model.joint_names[i] for i in self._both]
        self._wheels = self._wheel_tf = None
        if self.flag("publishWheelJointState", False):
            self._wheels = self.context.publisher("joint_states", JointState)
        if self.flag("publishWheelTF", False):
            self._wheel_tf = self.context.publisher("/tf", TFMessage)

    def moved(self, time_s: float, dt: float) -> None:
        if self._counted is None:
            return
        before, self._turned = self._turned, self._angles()
        left, right = self._radius * (self._turned - before)
        self._counted.move((left + right) / 2.0, self.turn(left, right, dt), dt)

    def turn(self, left: float, right: float, dt: float) -> float:
        """The angle [rad] that odometry counts for a step in which the rims moved by ``left`` and ``right`` [m]."""
        return (right - left) / self._separation

    def where(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        counted = self._counted
        if counted is None:
            return super().where()
        pose = np.eye(4)
        cosine, sine = math.cos(counted.heading), math.sin(counted.heading)
        pose[:2, :2] = [[cosine, -sine], [sine, cosine]]
        pose[:2, 3] = counted.x, counted.y
        return pose, np.array([counted.linear, 0.0, 0.0]), np.array([0.0, 0.0, counted.angular])

    def also_publish(self, time_s: float) -> None:
        if self._wheels is not None and self._wheels.has_listeners:
            position, velocity, effort = (values[self._both].tolist() for values in self.model.read_joints())
            message = JointState(None, self._wheel_names, position, velocity, effort)
            message.header.stamp = stamp(time_s)
            self._wheels.publish(message)
        if self._wheel_tf is not None and self._wheel_tf.has_listeners:
            self._wheel_tf.publish(TFMessage([self._wheel_transform(name, time_s) for name in self._wheel_names]))

    def _wheel_transform(self, name: str, time_s: float) -> TransformStamped:
        joint = self.context.robot.joints[name]
        parent, child = (self.model.link_pose(link).matrix() for link in (joint.parent, joint.child))
        return transform_msg(time_s, self.context.frame(joint.parent), self.context.frame(joint.child),
                          np.linalg.inv(parent) @ child)

    def joints_set(self) -> None:
        self._turned = self._angles()

    def reset(self) -> None:
        super().reset()
        self._turned = self._angles()
        if self._counted is not None:
            self._counted = WheelOdometry()

    def _angles(self) -> np.ndarray:
        position = self.model.read_joints()[0]
        return np.array([position[self._left].mean(), position[self._right].mean()])


class SkidSteer(_Wheels):
    """``libgazebo_ros_skid_steer_drive.so``. Elements besides those of :class:`Drive`: ``leftFrontJoint``,
    ``rightFrontJoint``, ``leftRearJoint``, ``rightRearJoint`` (left_front_joint, ...), ``wheelSeparation`` (0.4 m),
    ``wheelDiameter`` (0.15 m), ``torque`` (5 Nm at most), ``covariance_x``, ``covariance_y`` (0.0001 m2),
    ``covariance_yaw`` (0.01 rad2). ``broadcastTF`` (true) takes the place of ``publishOdomTF``.
    """

    torque_tag = "torque"
    tf_tag = "broadcastTF"
    acceleration = 0.0

    def sides(self) -> tuple[list[str], list[str]]:
        left, right = ([self.joint("%s%sJoint" % (side, end), "%s_%s_joint" % (side, end.lower()))
                        for end in ("Front", "Rear")] for side in ("left", "right"))
        return left, right

    def configure(self) -> None:
        super().configure()
        self._separation = self.positive("wheelSeparation", 0.4)
        self._radius = self.positive("wheelDiameter", 0.15) / 2.0
        self.variances = (self.number("covariance_x", 1e-4), self.number("covariance_y", 1e-4), _UNKNOWN, _UNKNOWN,
                          _UNKNOWN, self.number("covariance_yaw", 1e-2))


class PlanarMove(Drive):
    """``libgazebo_ros_planar_move.so``: the model moves as commanded on any ground.

    ``odometryRate`` (20 Hz) takes the place of ``updateRate``. ``cmdTimeout`` (below 0: none [s]): how long a command
    holds.
    """

    rate = 20.0
    rate_tag = "odometryRate"

    def configure(self) -> None:
        text = self.text("cmdTimeout", "-1")
        if not text.startswith("-"):
            self.timeout_s = self.number("cmdTimeout", 0.0)

    def drive(self, x: float, y: float, turn: float, dt: float) -> None:
        pose = self.model.base_pose().matrix()
        heading = math.atan2(pose[1, 0], pose[0, 0])
        cosine, sine = math.cos(heading), math.sin(heading)
        self.model.set_base_twist((x * cosine - y * sine, x * sine + y * cosine, 0.0), (0.0, 0.0, turn))


class ForceBasedMove(PlanarMove):
    """``libgazebo_ros_force_based_move.so`` and its kin: as :class:`PlanarMove`, but the model falls, tips and climbs.

    ``publishOdometryTf`` (true) takes the place of ``publishOdomTF``. The gains have no effect: it moves as commanded.
    """

    tf_tag = "publishOdometryTf"

    def drive(self, x: float, y: float, turn: float, dt: float) -> None:
        along, across = self.model.base_pose().matrix()[:3, :2].T
        linear, angular = (np.asarray(part) for part in self.model.base_twist())
        up = np.cross(along, across)
        linear = linear + (x - linear @ along) * along + (y - linear @ across) * across
        self.model.set_base_twist(tuple(linear), tuple(angular + (turn - angular @ up) * up))
