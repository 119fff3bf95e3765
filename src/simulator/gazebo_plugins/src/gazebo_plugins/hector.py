# SPDX-License-Identifier: BSD-3-Clause
"""Sensors under the file names of hector_gazebo_plugins: IMU, satellite navigation, magnetometer, sonar."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Quaternion, Vector3, Vector3Stamped
from sensor_msgs.msg import Imu, MagneticField, NavSatFix, Range
from std_srvs.srv import Empty, EmptyResponse

from gazebo_plugins.error_model import ErrorModel
from gazebo_plugins.globe import Reference, magnetic_field
from gazebo_ros.model_plugin import PluginError
from gazebo_ros.sensor_plugins import PacedSensor, RangeFinder
from urdf_model.transforms import pose_matrix, quaternion_from_matrix

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

# Element after the prefix -> argument of ErrorModel.
_ERRORS = {"offset": "offset", "drift": "drift", "driftFrequency": "frequency", "gaussianNoise": "noise",
           "scaleError": "scale"}


def error_model(sensor: PacedSensor, prefix: str = "", size: int = 3) -> ErrorModel:
    """The :class:`ErrorModel` that a sensor's elements describe: ``gaussianNoise``, ``accelGaussianNoise`` ..., with
    one number for all axes or one for each. Raises ``PluginError``."""
    found = {}
    for name, argument in _ERRORS.items():
        tag = prefix + name[0].upper() + name[1:] if prefix else name
        text = sensor.context.element_text(tag)
        if text is not None:
            found[argument] = sensor.numbers(sensor.context.element, tag, (0.0,) * len(text.split()))
            if len(found[argument]) not in (1, size):
                raise PluginError("%s: <%s> is '%s', expected 1 or %d numbers" % (sensor.what, tag, text, size))
    return ErrorModel(size, sensor.context.world.random, **found)


class _LinkSensor(PacedSensor):
    """A sensor on the link ``bodyName`` (the root where it is left out), in the frame ``frameId``."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        period = self.number("updatePeriod", 0.0)
        if period > 0.0:
            self._pace.rate = 1.0 / period
        named = context.element_text("bodyName") is not None
        self._link = self.link_named("bodyName") if named else context.model.robot.root
        self._frame = context.element_text("frameId", self.default_frame or self._link)
        self._last_s = None

    default_frame: str | None = None

    def elapsed(self, time_s: float) -> float:
        """Seconds since the last call, 0 at first."""
        last, self._last_s = self._last_s, time_s
        return 0.0 if last is None or time_s < last else time_s - last

    def _axes(self) -> np.ndarray:
        """Axes of the link (3, 3) in the world's."""
        return self.context.model.link_pose(self._link).matrix()[:3, :3]

    def reset(self) -> None:
        super().reset()
        self._last_s = None


class HectorImu(_LinkSensor):
    """``libhector_gazebo_ros_imu.so``: sensor_msgs/Imu on ``topicName`` (imu), its errors on ``biasTopicName``
    (imu/bias). ``rpyOffset`` turns it on its link; errors of ``accel``, ``rate`` and ``yaw``.

    The service ``serviceName`` (imu/calibrate) resets the drift of the rates to zero.
    """

    message_class = Imu
    default_topic = "imu"

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._accel, self._rate = error_model(self, "accel"), error_model(self, "rate")
        self._yaw = error_model(self, "yaw", 1)
        both = self.number("gaussianNoise", 0.0)
        if both:
            # The common value comes before those of each axis.
            self._accel.noise = self._rate.noise = np.full(3, both)
        self._turn = pose_matrix((0.0, 0.0, 0.0), self.numbers(context.element, "rpyOffset", (0.0,) * 3))[:3, :3]
        self._velocity = None
        self._bias = context.publisher(context.element_text("biasTopicName", self.topic + "/bias"), Imu)
        self._service = context.service(context.element_text("serviceName", self.topic + "/calibrate"), Empty,
                                        self._calibrate)

    def publish(self, time_s: float) -> None:
        if not (self.publisher.has_listeners or self._bias.has_listeners):
            self._velocity = None
            return
        linear, angular = (np.asarray(part) for part in self.context.model.link_twist(self._link))
        # The change over the last step, as in the IMU of gazebo_ros, and not over a period.
        last, self._velocity = self._velocity, (time_s, linear)
        if last is None or time_s <= last[0] or not self._pace.take(time_s):
            return
        elapsed = self.elapsed(time_s)
        link = self._axes()
        axes = self._turn @ link
        gravity = np.asarray(self.context.world.gravity)
        felt = self._accel.measure(axes.T @ ((linear - last[1]) / (time_s - last[0]) - gravity), elapsed)
        turning = self._rate.measure(axes.T @ angular, elapsed)
        self._yaw.measure((0.0,), elapsed)
        tilt = link @ self._accel.bias / max(float(np.linalg.norm(gravity)), 1e-9)
        wrong = pose_matrix((0.0, 0.0, 0.0), (tilt[1], -tilt[0], float(self._yaw.bias[0])))
        message = Imu(orientation=Quaternion(*quaternion_from_matrix(wrong[:3, :3] @ axes)),
                      angular_velocity=Vector3(*turning), linear_acceleration=Vector3(*felt))
        _diagonal(message.orientation_covariance, (self._accel.drift[0] ** 2, self._accel.drift[1] ** 2,
                                                   self._yaw.drift[0] ** 2))
        _diagonal(message.angular_velocity_covariance, self._rate.noise ** 2)
        _diagonal(message.linear_acceleration_covariance, self._accel.noise ** 2)
        self.publisher.publish(self.stamped(message, time_s, self._frame))
        if self._bias.has_listeners:
            bias = Imu(orientation=Quaternion(0.0, 0.0, 0.0, 1.0), angular_velocity=Vector3(*self._rate.bias),
                       linear_acceleration=Vector3(*self._accel.bias))
            self._bias.publish(self.stamped(bias, time_s, self._frame))

    def _calibrate(self, request):
        self._rate.add_drift(-self._rate.bias)
        return EmptyResponse()

    def reset(self) -> None:
        super().reset()
        self._velocity = None
        for model in (self._accel, self._rate, self._yaw):
            model.reset()


class HectorGps(_LinkSensor):
    """``libhector_gazebo_ros_gps.so``: sensor_msgs/NavSatFix on ``topicName`` (fix), and the velocity north, west and
    up as Vector3Stamped on ``velocityTopicName`` (fix_velocity). ``referenceLatitude`` (49.9), ``referenceLongitude``
    (8.9), ``referenceHeading`` (0) [deg], ``referenceAltitude`` (0) [m]; ``status``, ``service``; errors of the
    position and of the ``velocity``.
    """

    message_class = NavSatFix
    default_topic = "fix"
    default_frame = "/world"

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._reference = Reference(self.number("referenceLatitude", 49.9), self.number("referenceLongitude", 8.9),
                                    self.number("referenceAltitude", 0.0),
                                    math.radians(self.number("referenceHeading", 0.0)))
        self._status, self._service = round(self.number("status", 0.0)), round(self.number("service", 0.0))
        self._position, self._speed = error_model(self), error_model(self, "velocity")
        self._velocity = context.publisher(context.element_text("velocityTopicName", "fix_velocity"), Vector3Stamped)

    def publish(self, time_s: float) -> None:
        wanted = self.publisher.has_listeners, self._velocity.has_listeners
        if not any(wanted) or not self._pace.take(time_s):
            return
        model, elapsed = self.context.model, self.elapsed(time_s)
        velocity = self._speed.measure(model.link_twist(self._link)[0], elapsed)
        position = self._position.measure(model.link_pose(self._link).position, elapsed)
        # Drift of the velocity integrates to drift of the position.
        self._position.add_drift(elapsed * self._speed.bias)
        if wanted[0]:
            latitude, longitude, altitude = self._reference.place(position)
            fix = NavSatFix(latitude=latitude, longitude=longitude, altitude=altitude,
                            position_covariance_type=NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN)
            fix.status.status, fix.status.service = self._status, self._service
            _diagonal(fix.position_covariance, self._position.drift ** 2 + self._position.noise ** 2)
            self.publisher.publish(self.stamped(fix, time_s, self._frame))
        if wanted[1]:
            message = Vector3Stamped(vector=Vector3(*self._reference.north_west_up(velocity)))
            self._velocity.publish(self.stamped(message, time_s, self._frame))

    def reset(self) -> None:
        super().reset()
        self._position.reset()
        self._speed.reset()


class HectorMagnetic(_LinkSensor):
    """``libhector_gazebo_ros_magnetic.so``: the field in the link's axes on ``topicName`` (magnetic) as Vector3Stamped,
    or sensor_msgs/MagneticField where ``useMagneticFieldMsgs``. ``magnitude`` (1), ``referenceHeading`` (0),
    ``declination`` (0), ``inclination`` (60) [deg]; errors."""

    default_topic = "magnetic"

    def __init__(self, context: PluginContext) -> None:
        said = context.element_text("useMagneticFieldMsgs", "false").lower()
        self.message_class = MagneticField if said in ("true", "1") else Vector3Stamped
        super().__init__(context)
        heading, declination, inclination = (
            math.radians(self.number(tag, default))
            for tag, default in (("referenceHeading", 0.0), ("declination", 0.0), ("inclination", 60.0)))
        self._field = magnetic_field(self.number("magnitude", 1.0), inclination, declination, heading)
        self._errors = error_model(self)

    def publish(self, time_s: float) -> None:
        if self.is_due(time_s):
            field = Vector3(*self._errors.measure(self._axes().T @ self._field, self.elapsed(time_s)))
            message = (MagneticField(magnetic_field=field) if self.message_class is MagneticField
                       else Vector3Stamped(vector=field))
            self.publisher.publish(self.stamped(message, time_s, self._frame))

    def reset(self) -> None:
        super().reset()
        self._errors.reset()


class HectorSonar(RangeFinder):
    """``libhector_gazebo_ros_sonar.so``: the nearest of all rays as sensor_msgs/Range on ``topicName`` (sonar), in the
    frame ``frameId`` (/sonar_link); errors."""

    default_topic = "sonar"

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self.frame = context.element_text("frameId", "/sonar_link")
        # RangeFinder's own noise would come on top.
        self._noise = 0.0
        self._radiation = Range.ULTRASOUND
        self._errors = error_model(self, size=1)

    def message(self, ranges: np.ndarray) -> Range:
        message = super().message(ranges)
        if message.range < message.max_range:
            measured = float(self._errors.measure((message.range,), self._pace.period_s)[0])
            message.range = min(max(measured, message.min_range), message.max_range)
        return message

    def reset(self) -> None:
        super().reset()
        self._errors.reset()


def _diagonal(covariance, variances):
    """Fill the diagonal of a message's 3 x 3 matrix."""
    covariance[0], covariance[4], covariance[8] = (float(value) for value in variances)
