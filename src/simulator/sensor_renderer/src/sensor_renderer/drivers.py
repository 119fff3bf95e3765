# SPDX-License-Identifier: BSD-3-Clause
"""Camera drivers: the topics of a sensor plugin.

A driver is made from a :class:`SensorEntry`. The drawing thread asks whether it is due and makes it publish.
``config/camera_drivers.yaml`` maps plugin file names to drivers.
"""
from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

from rosgraph.names import is_legal_name
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from loop_ros.reconfigure import Setting
from sensor_renderer import convert
from sensor_renderer.camera_sensor import CameraSensor
from sensor_renderer.camera_settings import ServedCameraSettings
from sensor_renderer.errors import SensorError
from sensor_renderer.pictures import Cloud, millimetres, within
from sensor_renderer.structured_light import StructuredLight
from sensor_renderer.topics import ColourTopics, LearningTopics, Trigger, WatchedTopic
from sim_time.pace import Pace

if TYPE_CHECKING:
    from sensor_renderer.moments import Moment
    from sensor_renderer.sensor_element import SensorEntry

_FASTEST_HZ = 1000.0


class Driver:
    """Base class: what all cameras have."""

    def __init__(self, entry: SensorEntry) -> None:
        """Raises :class:`sensor_renderer.errors.SensorError` for a sensor that cannot be used."""
        self.entry = entry
        self.topics = []
        self._pace = Pace(entry.rate)
        #: How long the world must remember its states for this sensor [s].
        self.memory_s = 0.0

    def name(self, text: str) -> str:
        """A ROS name: relative ones live in the sensor's namespace. Raises :class:`SensorError` for an invalid name."""
        name = text if text.startswith("/") else "%s/%s" % (self.entry.namespace, text)
        if not is_legal_name(name):
            raise SensorError("%s: '%s' is not a name in ROS; expected letters, digits and _ between slashes"
                              % (self.entry, name))
        return name

    @property
    def rate_setting(self) -> Setting:
        """The setting of the rate, under the name that Gazebo's cameras use."""
        return Setting("imager_rate", self._pace.rate, 0.0, _FASTEST_HZ,
                       "pictures a second [Hz]; 0: one of every state")

    def seed(self, camera_name: str) -> int:
        """The seed of a camera's noise: the same in every run, another for each camera."""
        return zlib.crc32(("%s %s" % (self.entry, camera_name)).encode())

    def under_camera(self, text: str, camera_name: str) -> str:
        """A topic below the camera's own name."""
        return self.name(text if text.startswith("/") else "%s/%s" % (camera_name, text))

    @property
    def has_listeners(self) -> bool:
        """Whether a topic of this sensor has subscribers."""
        return any(topic.has_listeners for topic in self.topics)

    def time_was_reset(self) -> None:
        """The next state is new, even if its time is the same."""
        self._pace.restart()

    def is_due(self, time_s: float) -> bool:
        """Whether there is anything to do for the state at ``time_s``."""
        return self._pace.is_due(time_s) and self.has_listeners

    def take(self, moment: Moment) -> None:
        """Publish the view at a :class:`sensor_renderer.moments.Moment` of the sensor's link."""
        self._pace.took(moment.time_s)
        self.publish(moment)

    def publish(self, moment: Moment) -> None:
        """Draw and publish the topics that have subscribers."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the topics: the sensor was deleted."""
        for topic in self.topics:
            topic.close()


class Camera(Driver):
    """``libgazebo_ros_camera.so``, ``libgazebo_ros_prosilica.so``, and with a folder for each camera
    ``libgazebo_ros_multicamera.so``."""

    def __init__(self, entry: SensorEntry) -> None:
        super().__init__(entry)
        cameras = entry.cameras()
        base = entry.text("cameraName", entry.name)
        self._frame = entry.frame
        self._cameras = []
        self._folders = [base if len(cameras) == 1 else "%s/%s" % (base, camera.name) for camera in cameras]
        for camera, folder in zip(cameras, self._folders, strict=True):
            topics = ColourTopics(self.under_camera(entry.text("imageTopicName", "image_raw"), folder),
                                  [self.under_camera(entry.text("cameraInfoTopicName", "camera_info"), folder)])
            learning = LearningTopics(self.name(folder))
            info = convert.camera_info(entry.stated(camera.pinhole), entry.baseline_m(camera), camera.distortion)
            self._cameras.append((CameraSensor(camera, self.seed(camera.name)), topics, learning, info))
            self.topics += [*topics.all, learning]
        first = cameras[0]
        self._settings = ServedCameraSettings(self.name(base), self._apply, (first.noise_mean, first.noise),
                                              more=[self.rate_setting])
        self.topics.append(self._settings)

    def takes(self, number: int) -> bool:
        """Whether the camera of that number takes this picture."""
        return True

    def _apply(self, settings):
        self._pace.rate = settings.value("imager_rate")
        self.memory_s = settings.exposure.exposure_time
        for sensor, _, learning, _ in self._cameras:
            settings.apply(sensor, learning)

    def publish(self, moment: Moment) -> None:
        for number, (sensor, topics, learning, info) in enumerate(self._cameras):
            if not self.takes(number):
                continue
            middle, picture, _ = sensor.taken(moment, topics.want_picture, False)
            topics.publish(middle.time_s, self._frame, picture, sensor.camera.encoding, info)
            learning.publish(middle, sensor.camera, self._frame)


class TriggeredCamera(Camera):
    """``libgazebo_ros_triggered_camera.so`` and ``libgazebo_ros_triggered_multicamera.so``: a picture for each
    std_msgs/Empty on ``triggerTopicName`` (image_trigger) below the name of each
    camera. A trigger without a subscriber to the pictures is used up."""

    def __init__(self, entry: SensorEntry) -> None:
        super().__init__(entry)
        self._triggers = [Trigger(self.under_camera(entry.text("triggerTopicName", "image_trigger"), folder))
                          for folder in self._folders]
        self.topics = [*self.topics, *self._triggers]

    def is_due(self, time_s: float) -> bool:
        if not self.has_listeners:
            for trigger in self._triggers:
                trigger.clear()
        return any(trigger.count for trigger in self._triggers) and super().is_due(time_s)

    def takes(self, number: int) -> bool:
        return self._triggers[number].take()


class DepthCamera(Driver):
    """``libgazebo_ros_openni_kinect.so`` and ``libgazebo_ros_depth_camera.so``: colour, depth, points."""

    def __init__(self, entry: SensorEntry) -> None:
        super().__init__(entry)
        self._camera = entry.cameras()[0]
        pinhole = self._camera.pinhole
        base = entry.text("cameraName", entry.name)
        self._frame = entry.frame
        self._nearest = entry.number(entry.plugin, "pointCloudCutoff", pinhole.near)
        self._furthest = entry.number(entry.plugin, "pointCloudCutoffMax", pinhole.far)
        self._in_millimetres = entry.text("useDepth16UC1Format", "false").lower() in ("1", "true")

        def topic(tag, default, message_class):
            return WatchedTopic(self.under_camera(entry.text(tag, default), base), message_class)

        colour_name = self.under_camera(entry.text("imageTopicName", "rgb/image_raw"), base)
        info_name = self.under_camera(entry.text("cameraInfoTopicName", "rgb/camera_info"), base)
        self._colour = ColourTopics(colour_name, [info_name])
        self._depth = topic("depthImageTopicName", "depth/image_raw", Image)
        self._depth_info = topic("depthImageCameraInfoTopicName", "depth/camera_info", CameraInfo)
        self._points = topic("pointCloudTopicName", "depth/points", PointCloud2)
        self._learning = LearningTopics(self.name(base))
        self._cloud = Cloud(pinhole, self._camera.lens and self._camera.lens.rays)
        self._sensor = CameraSensor(self._camera, self.seed(base))
        self._pattern = None
        distortion = self._camera.distortion
        stated = entry.stated(pinhole)
        self._info = convert.camera_info(stated, entry.baseline_m(self._camera), distortion)
        self._plain_info = convert.camera_info(stated, 0.0, distortion)
        settings = ServedCameraSettings(self.name(base), self._apply, (self._camera.noise_mean, self._camera.noise),
                                        more=[
            self.rate_setting, Setting("depth_noise", False, meaning="depth as the first Kinect measures it")])
        self.topics = [*self._colour.all, self._depth, self._depth_info, self._points, self._learning, settings]

    def _apply(self, settings):
        self._pace.rate = settings.value("imager_rate")
        self.memory_s = settings.exposure.exposure_time
        settings.apply(self._sensor, self._learning)
        if not settings.value("depth_noise"):
            self._pattern = None
        elif self._pattern is None:
            self._pattern = StructuredLight(self._camera.pinhole, self.seed("depth"))

    def publish(self, moment: Moment) -> None:
        points = self._points.has_listeners
        want_colour, want_depth = points or self._colour.want_picture, points or self._depth.has_listeners
        pattern, picture, depth = self._pattern, None, None
        if want_colour or want_depth:
            moment, picture, depth = self._sensor.taken(moment, want_colour, want_depth)
        time_s = moment.time_s
        if depth is not None:
            if pattern is not None:
                depth = pattern.measured(depth, time_s)
            depth = within(depth, self._nearest, self._furthest)
        self._colour.publish(time_s, self._frame, picture, self._camera.encoding, self._plain_info)
        if self._depth_info.has_listeners:
            self._depth_info.publish(convert.header(self._info, time_s, self._frame))
        if depth is not None and self._depth.has_listeners:
            values = millimetres(depth) if self._in_millimetres else depth
            self._depth.publish(convert.header(convert.depth_image(values), time_s, self._frame))
        if points and picture is not None and depth is not None:
            found = self._cloud.points(depth, picture)
            self._points.publish(convert.header(convert.point_cloud(found), time_s, self._frame))
        self._learning.publish(moment, self._camera, self._frame)
