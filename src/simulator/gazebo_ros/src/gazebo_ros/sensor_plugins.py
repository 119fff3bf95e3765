# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's sensor plugins that measure without pictures: laser, range finder, IMU, bumper, pose, joint states."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from gazebo_msgs.msg import ContactsState
from geometry_msgs.msg import Quaternion, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState, LaserScan, Range
from std_srvs.srv import Empty, EmptyResponse

from bullet_sim import Pose
from gazebo_ros.contact_messages import CollisionNames, contact_states
from gazebo_ros.convert import msg_from_pose, msg_from_twist
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.ray_pattern import RayPattern, RayPatternError, Sweep
from gazebo_ros.urdf_extras import sensor_of, unscoped
from sim_time.pace import Pace
from sim_time.stamps import stamp
from urdf_model import gazebo_links
from urdf_model.transforms import pose_matrix, quaternion_from_matrix

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    import genpy

    from gazebo_ros.model_plugin import PluginContext

# No element of a sensor means more than this; squares of it can be computed with.
_MOST = 1e12
# A sensor with a lower rate above 0 measures once. Messages have the period in 32 bits.
_SLOWEST_HZ = 1e-9


class PacedSensor(ModelPlugin):
    """Base class: one topic, published at a rate while it has subscribers. Names come from the plugin's elements."""

    message_class: type[genpy.Message]
    topic_tag = "topicName"
    default_topic: str | None = None
    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self.sensor, self.link = sensor_of(context.element)
        self.what = "sensor plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        own = self.number("updateRate", 0.0)
        rate = own if own > 0.0 or self.sensor is None else self.number_in(self.sensor, "update_rate", 0.0)
        self._pace = Pace(max(_SLOWEST_HZ, rate) if rate > 0.0 else 0.0)
        topic = context.element_text(self.topic_tag, self.default_topic)
        if topic is None:
            raise PluginError("%s names no topic; expected <%s>" % (self.what, self.topic_tag))
        #: The topic as it is written.
        self.topic = topic
        self.publisher = context.publisher(topic, self.message_class)

    def number(self, tag: str, default: float) -> float:
        """A number of the plugin's element; raises ``PluginError``."""
        return self.number_in(self.context.element, tag, default)

    def number_in(self, element: Any, tag: str, default: float) -> float:
        """A number of an element's child."""
        return self.numbers(element, tag, (default,))[0]

    def numbers(self, element: Any, tag: str, defaults: Sequence[float]) -> tuple[float, ...]:
        """As many numbers as ``defaults`` has, up to _MOST each, with a warning beyond; raises ``PluginError``."""
        text = (element.findtext(tag) or "").strip()
        try:
            values = tuple(float(word) for word in text.split()) or tuple(defaults)
        except ValueError:
            values = ()
        if len(values) != len(defaults) or not np.isfinite(values).all():
            raise PluginError("%s: <%s> is '%s', expected %d number%s"
                              % (self.what, tag, text, len(defaults), "" if len(defaults) == 1 else "s"))
        used = tuple(min(max(value, -_MOST), _MOST) for value in values)
        if used != values:
            self.context.log.warn("%s: <%s> is '%s', of which %g is used at most" % (self.what, tag, text, _MOST))
        return used

    def noise(self) -> float:
        """The standard deviation ``gaussianNoise``, 0 by default. A negative one means its amount, as in Gazebo."""
        return abs(self.number("gaussianNoise", 0.0))

    def sensor_pose(self) -> np.ndarray:
        """The pose (4, 4) of the ``<sensor>`` in its link."""
        values = self.numbers(self.sensor, "pose", (0.0,) * 6)
        return pose_matrix(values[:3], values[3:])

    def link_named(self, tag: str) -> str:
        """The link that the plugin's element ``tag`` names; raises ``PluginError``."""
        name = self.context.element_text(tag)
        found = None if name is None else unscoped(self.context.model.name, name)
        if found is None or found not in self.context.model.merged.frames:
            raise PluginError("%s: <%s> is '%s', expected one of the links %s"
                              % (self.what, tag, name or "", ", ".join(self.context.model.merged.frames)))
        return found

    def is_due(self, time_s: float) -> bool:
        """Whether the next measurement is due; if so, it counts as taken."""
        return self.publisher.has_listeners and self._pace.take(time_s)

    def stamped(self, message: Any, time_s: float, frame: str) -> Any:
        """``message`` with its header filled."""
        message.header.stamp = stamp(time_s)
        message.header.frame_id = frame
        return message

    def reset(self) -> None:
        self._pace.restart()


class RaySensor(PacedSensor):
    """A sensor of rays, cast into the collision shapes."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        if self.sensor is None or self.link is None:
            raise PluginError('%s stands outside of a <sensor>; expected <gazebo reference="LINK"><sensor><plugin>'
                              % self.what)
        self._link = self.link
        element = self.sensor.find("ray")
        try:
            self.pattern = RayPattern(element if element is not None else self.sensor.find("lidar"), self.what)
        except RayPatternError as error:
            raise PluginError(str(error)) from error
        for remark in self.pattern.remarks:
            context.log.warn(remark)
        self.frame = context.frame(context.element_text("frameName", self._link))
        self._offset = self.sensor_pose()
        self._start_sweep()
        self._sweeping = False

    def publish(self, time_s: float) -> None:
        if not self._sweeping:
            if not self.is_due(time_s):
                return
            self._sweeping = True
            self._began_s = time_s
        ranges = self._sweep.go_on(self.context.model.link_pose(self._link).matrix() @ self._offset)
        if ranges is not None:
            self._sweeping = False
            self.publisher.publish(self.stamped(self.message(ranges), self._began_s, self.frame))

    def message(self, ranges: np.ndarray) -> genpy.Message:
        """The message for ``ranges`` (n,) [m]."""
        raise NotImplementedError

    def reset(self) -> None:
        super().reset()
        self._start_sweep()
        self._sweeping = False

    def _start_sweep(self) -> None:
        world = self.context.world
        self._sweep = Sweep(self.pattern, world.ray_test_batch, world.random)


class Laser(RaySensor):
    """``libgazebo_ros_laser.so``, ``libgazebo_ros_gpu_laser.so``. Of several rows the middle one is published. The
    intensities are 0, as in Gazebo for surfaces without a ``<laser_retro>``."""

    message_class = LaserScan
    named_if_empty = True

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._intensities = [0.0] * self.pattern.columns

    def message(self, ranges: np.ndarray) -> LaserScan:
        pattern = self.pattern
        row = ranges.reshape(pattern.rows, pattern.columns)[pattern.rows // 2]
        return LaserScan(angle_min=pattern.angle_min, angle_max=pattern.angle_max, angle_increment=pattern.increment,
                         scan_time=self._pace.period_s, range_min=pattern.range_min, range_max=pattern.range_max,
                         ranges=row.tolist(), intensities=self._intensities)


class RangeFinder(RaySensor):
    """``libgazebo_ros_range.so``: the nearest of all rays, the largest range when none meets anything."""

    message_class = Range

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._field = self.number("fov", self.pattern.field)
        said = context.element_text("radiation", "infrared").lower()
        self._radiation = Range.ULTRASOUND if said == "ultrasound" else Range.INFRARED
        self._noise = self.noise()

    def message(self, ranges: np.ndarray) -> Range:
        nearest = min(float(ranges.min()), self.pattern.range_max)
        if self._noise and nearest < self.pattern.range_max:
            nearest += self.context.world.random.normal(0.0, self._noise)
        return Range(radiation_type=self._radiation, field_of_view=self._field, min_range=self.pattern.range_min,
                     max_range=self.pattern.range_max, range=nearest)


class ImuSensor(PacedSensor):
    """``libgazebo_ros_imu.so`` and ``libgazebo_ros_imu_sensor.so``: orientation in the world, rates and accelerations
    in the axes and at the place of the link, or of a ``<sensor>``'s ``<pose>`` in it. The acceleration is the proper
    one: at rest, gravity upwards. ``rpyOffset`` turns the orientation; with ``initialOrientationAsReference`` (default
    false) the orientation starts at identity; the service ``serviceName`` exists and does nothing."""

    message_class = Imu
    default_topic = "imu"

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        rate = self.number("updateRateHZ", 0.0)
        if rate > 0.0:
            self._pace.rate = rate
        self._body = self.link if self.link is not None else self.link_named("bodyName")
        self._frame = context.element_text("frameName", self._body)
        self._place = np.eye(4) if self.sensor is None else self.sensor_pose()
        self._noise = self.noise()
        self._turn = pose_matrix((0.0, 0.0, 0.0), self.numbers(context.element, "rpyOffset", (0.0,) * 3))[:3, :3]
        if context.element_text("initialOrientationAsReference", "false").lower() in ("true", "1"):
            self._turn = self._turn @ self._matrix()[:3, :3].T
        service = context.element_text("serviceName")
        if service is not None:
            context.service(service, Empty, lambda request: EmptyResponse())
        self._last = None

    def _matrix(self) -> np.ndarray:
        return self.context.model.link_pose(self._body).matrix() @ self._place

    def publish(self, time_s: float) -> None:
        if not self.publisher.has_listeners:
            self._last = None
            return
        linear, angular = self.context.model.link_twist(self._body)
        pose = self._matrix()
        axes = pose[:3, :3]
        linear = np.asarray(linear) + np.cross(angular, axes @ (self._place[:3, :3].T @ self._place[:3, 3]))
        last, self._last = self._last, (time_s, linear)
        if last is None or time_s <= last[0] or not self.is_due(time_s):
            return
        felt = axes.T @ ((linear - last[1]) / (time_s - last[0]) - np.asarray(self.context.world.gravity))
        turning = axes.T @ np.asarray(angular)
        if self._noise:
            random = self.context.world.random
            felt, turning = felt + random.normal(0.0, self._noise, 3), turning + random.normal(0.0, self._noise, 3)
        message = Imu(angular_velocity=Vector3(*turning), linear_acceleration=Vector3(*felt))
        message.orientation = Quaternion(*quaternion_from_matrix(self._turn @ axes))
        for covariance in (message.orientation_covariance, message.angular_velocity_covariance,
                           message.linear_acceleration_covariance):
            covariance[0] = covariance[4] = covariance[8] = self._noise ** 2
        self.publisher.publish(self.stamped(message, time_s, self._frame))

    def reset(self) -> None:
        super().reset()
        self._last = None


class PoseSensor(PacedSensor):
    """``libgazebo_ros_p3d.so``: pose and velocity of a link, in the world's axes or another link's."""

    message_class = Odometry

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._body = self.link_named("bodyName")
        frame = context.element_text("frameName", "world")
        self._reference = None if frame.strip("/") in ("world", "map", "") else self.link_named("frameName")
        self._frame = context.frame(frame)
        self._offset = np.array(self.numbers(context.element, "xyzOffset", (0.0,) * 3))
        turn = "rpyOffset" if context.element.find("rpyOffset") is not None else "rpyOffsets"
        self._turn = pose_matrix((0.0, 0.0, 0.0), self.numbers(context.element, turn, (0.0,) * 3))
        self._noise = self.noise()

    def publish(self, time_s: float) -> None:
        if not self.is_due(time_s):
            return
        model = self.context.model
        pose = model.link_pose(self._body).matrix()
        linear, angular = (np.asarray(part) for part in model.link_twist(self._body))
        if self._reference is not None:
            origin = model.link_pose(self._reference).matrix()
            its_linear, its_angular = (np.asarray(part) for part in model.link_twist(self._reference))
            away = pose[:3, 3] - origin[:3, 3]
            linear = origin[:3, :3].T @ (linear - its_linear - np.cross(its_angular, away))
            angular = origin[:3, :3].T @ (angular - its_angular)
            pose = np.linalg.inv(origin) @ pose
        pose = pose @ self._turn
        pose[:3, 3] += self._offset
        if self._noise:
            random = self.context.world.random
            linear, angular = linear + random.normal(0.0, self._noise, 3), angular + random.normal(0.0, self._noise, 3)
        message = Odometry(child_frame_id=self._body)
        message.pose.pose = msg_from_pose(Pose.from_matrix(pose))
        message.twist.twist = msg_from_twist(linear, angular)
        for covariance in (message.pose.covariance, message.twist.covariance):
            covariance[::7] = [self._noise ** 2] * 6
        self.publisher.publish(self.stamped(message, time_s, self._frame))


class Bumper(PacedSensor):
    """``libgazebo_ros_bumper.so``: what touches the link of its ``<sensor>``, or the collisions of it that the sensor's
    ``<contact>`` names, and how hard."""

    message_class = ContactsState
    topic_tag, default_topic = "bumperTopicName", "bumper_states"

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        if self.sensor is None or self.link is None:
            raise PluginError('%s stands outside of a <sensor>; expected <gazebo reference="LINK"><sensor><plugin>'
                              % self.what)
        self._frame = context.frame(context.element_text("frameName", "world"))
        self._names = CollisionNames(context.world)
        known = self._names.of_link(context.model, gazebo_links(context.model.robot).get(self.link, self.link))
        asked = [(element.text or "").strip() for element in self.sensor.iterfind("contact/collision")]
        unknown = [name for name in asked if name not in known and name != "__default__"]
        if unknown:
            context.log.warn("%s: <collision> is '%s', and all contacts of the link are published; its collisions are "
                             "%s" % (self.what, "', '".join(unknown), ", ".join(known) or "none"))
            asked = []
        self._watched = frozenset(known[name] for name in asked if name in known) or frozenset(known.values())

    def publish(self, time_s: float) -> None:
        if not self.is_due(time_s):
            return
        model = self.context.model
        states = contact_states(self.context.world.contacts(model), self._names, self._watched)
        self.publisher.publish(self.stamped(ContactsState(states=states), time_s, self._frame))


class JointStatePublisher(PacedSensor):
    """``libgazebo_ros_joint_state_publisher.so``: positions, velocities and efforts of the joints in ``jointName``,
    names with commas between them; all movable joints where it is left out."""

    message_class = JointState
    default_topic = "joint_states"
    named_after_model = True

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        model = context.model
        text = context.element_text("jointName", "")
        names = text.replace(",", " ").split() or list(model.joint_names)
        unknown = [name for name in names if name not in model.joint_names]
        if unknown:
            raise PluginError("%s: <jointName> has %s, expected some of %s"
                              % (self.what, ", ".join(unknown), ", ".join(model.joint_names) or "no joint at all"))
        self._names = names
        self._index = model.index(names)

    def publish(self, time_s: float) -> None:
        if self.is_due(time_s):
            position, velocity, effort = (values[self._index].tolist() for values in self.context.model.read_joints())
            self.publisher.publish(self.stamped(JointState(name=self._names, position=position, velocity=velocity,
                                                           effort=effort), time_s, ""))
