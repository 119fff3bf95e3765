# SPDX-License-Identifier: BSD-3-Clause
"""Camera drivers: the topics of a sensor plugin.

A driver is made from a :class:`SensorEntry`. The drawing thread asks whether it is due and makes it publish.
``config/camera_drivers.yaml`` maps plugin file names to drivers.
"""
import threading

import rospy
from rosgraph.names import is_legal_name
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2

from loop_ros.reconfigure import Setting, SettingsServer
from sensor_renderer import convert
from sensor_renderer.errors import SensorError
from sensor_renderer.pictures import Cloud, Noise, millimetres, within
from sim_time.pace import Pace

_FASTEST_HZ = 1000.0


class Topic:
    """A publisher that knows whether it has subscribers. A service's thread may close it at any time."""

    def __init__(self, name, message_class):
        # A queue of one: a subscriber that has stopped reading loses pictures and delays nobody.
        self._publisher = rospy.Publisher(name, message_class, queue_size=1)
        self._lock = threading.Lock()

    @property
    def has_listeners(self):
        """True while a subscriber is connected."""
        with self._lock:
            return self._publisher is not None and self._publisher.get_num_connections() > 0

    def publish(self, message):
        """Send a message, unless the topic has been closed."""
        with self._lock:
            if self._publisher is not None:
                self._publisher.publish(message)

    def close(self):
        """Unregister the topic."""
        with self._lock:
            publisher, self._publisher = self._publisher, None
        if publisher is not None:
            publisher.unregister()


class ReconfigureServer:
    """Settings for clients of dynamic_reconfigure; closed like a topic."""

    #: These topics need no picture.
    has_listeners = False

    def __init__(self, name, settings, apply):
        """As :class:`loop_ros.reconfigure.SettingsServer`; ``apply`` is called in a service's thread."""
        self._opened = []
        self._lock = threading.Lock()
        SettingsServer(self, name, settings, apply)

    def publisher(self, topic, msg_class, latch):
        """For SettingsServer."""
        publisher = rospy.Publisher(topic, msg_class, latch=latch, queue_size=1)
        self._opened.append(publisher.unregister)
        return publisher

    def service(self, name, srv_class, handler):
        """For SettingsServer."""
        def one_at_a_time(request):
            with self._lock:
                return handler(request)

        try:
            service = rospy.Service(name, srv_class, one_at_a_time)
        except rospy.ServiceException:
            rospy.logwarn("%s: another camera of this name has it already" % name)
            return
        self._opened.append(lambda: service.shutdown("the sensor is gone"))

    def close(self):
        """Unregister topics and service."""
        while self._opened:
            self._opened.pop()()


class ColourTopics:
    """Image, compressed image and camera_info of one colour camera."""

    def __init__(self, image_topic, info_topics):
        self.image = Topic(image_topic, Image)
        self.compressed = Topic(image_topic + "/compressed", CompressedImage)
        self.infos = [Topic(name, CameraInfo) for name in info_topics]
        self._quality = convert.JPEG_QUALITY
        settings = ReconfigureServer(image_topic + "/compressed", [
            Setting("jpeg_quality", self._quality, 1, 100, "of the pictures, in percent")], self._apply)
        self.all = [self.image, self.compressed, *self.infos, settings]

    def _apply(self, values):
        self._quality = values["jpeg_quality"]

    @property
    def want_picture(self):
        """Whether a picture topic has subscribers."""
        return self.image.has_listeners or self.compressed.has_listeners

    def publish(self, time_s, frame, picture, encoding, info):
        """``picture`` may be None without subscribers."""
        for topic in self.infos:
            if topic.has_listeners:
                topic.publish(convert.header(info, time_s, frame))
        if picture is not None and self.image.has_listeners:
            self.image.publish(convert.header(convert.image(picture, encoding), time_s, frame))
        if picture is not None and self.compressed.has_listeners:
            self.compressed.publish(convert.header(convert.compressed_image(picture, self._quality), time_s, frame))


class Driver:
    """Base class: what all cameras have."""

    def __init__(self, entry):
        """Raises :class:`sensor_renderer.errors.SensorError` for a sensor that cannot be used."""
        self.entry = entry
        self.topics = []
        self._pace = Pace(entry.rate)

    def name(self, text):
        """A ROS name: relative ones live in the sensor's namespace. Raises :class:`SensorError` for an invalid name."""
        name = text if text.startswith("/") else "%s/%s" % (self.entry.namespace, text)
        if not is_legal_name(name):
            raise SensorError("%s: '%s' is not a name in ROS; expected letters, digits and _ between slashes"
                              % (self.entry, name))
        return name

    def rate_setting(self, camera_name):
        """The setting of the rate, under the name that Gazebo's cameras use."""
        def apply(values):
            self._pace.rate = values["imager_rate"]

        return ReconfigureServer(self.name(camera_name), [
            Setting("imager_rate", self._pace.rate, 0.0, _FASTEST_HZ, "pictures a second [Hz]; 0: one of every state")],
            apply)

    def under_camera(self, text, camera_name):
        """A topic below the camera's own name."""
        return self.name(text if text.startswith("/") else "%s/%s" % (camera_name, text))

    @property
    def has_listeners(self):
        """Whether a topic of this sensor has subscribers."""
        return any(topic.has_listeners for topic in self.topics)

    def time_was_reset(self):
        """The next state is new, even if its time is the same."""
        self._pace.restart()

    def is_due(self, time_s):
        """Whether there is anything to do for the state at ``time_s``."""
        return self._pace.is_due(time_s) and self.has_listeners

    def take(self, time_s, link_pose, draw):
        """Publish the view at ``time_s`` of a sensor whose link is at ``link_pose`` (4, 4).

        ``draw(pinhole, pose, colour, depth)`` -> (picture, depth).
        """
        self._pace.took(time_s)
        self.publish(time_s, link_pose, draw)

    def publish(self, time_s, link_pose, draw):
        """Draw and publish the topics that have subscribers."""
        raise NotImplementedError

    def close(self):
        """Close the topics: the sensor was deleted."""
        for topic in self.topics:
            topic.close()


class Camera(Driver):
    """``libgazebo_ros_camera.so``, and ``libgazebo_ros_multicamera.so`` with a folder for each camera."""

    def __init__(self, entry):
        super().__init__(entry)
        cameras = entry.cameras()
        base = entry.text("cameraName", entry.name)
        self._frame = entry.text("frameName", entry.member)
        self._cameras = []
        baseline = entry.number(entry.plugin, "hackBaseline", 0.0)
        for camera in cameras:
            folder = base if len(cameras) == 1 else "%s/%s" % (base, camera.name)
            topics = ColourTopics(self.under_camera(entry.text("imageTopicName", "image_raw"), folder),
                                  [self.under_camera(entry.text("cameraInfoTopicName", "camera_info"), folder)])
            self._cameras.append((camera, topics, Noise(camera.noise) if camera.noise else None,
                                  convert.camera_info(camera.pinhole, baseline, camera.distortion)))
            self.topics += topics.all
        self.topics.append(self.rate_setting(base))

    def publish(self, time_s, link_pose, draw):
        for camera, topics, noise, info in self._cameras:
            picture = None
            if topics.want_picture:
                picture, _ = camera.view(link_pose, draw, True, False)
                picture = noise.add(picture) if noise else picture
            topics.publish(time_s, self._frame, picture, camera.encoding, info)


class DepthCamera(Driver):
    """``libgazebo_ros_openni_kinect.so`` and ``libgazebo_ros_depth_camera.so``: colour, depth, points."""

    def __init__(self, entry):
        super().__init__(entry)
        self._camera = entry.cameras()[0]
        pinhole = self._camera.pinhole
        base = entry.text("cameraName", entry.name)
        self._frame = entry.text("frameName", entry.member)
        self._nearest = entry.number(entry.plugin, "pointCloudCutoff", pinhole.near)
        self._furthest = entry.number(entry.plugin, "pointCloudCutoffMax", pinhole.far)
        self._in_millimetres = entry.text("useDepth16UC1Format", "false").lower() in ("1", "true")

        def topic(tag, default, message_class):
            return Topic(self.under_camera(entry.text(tag, default), base), message_class)

        colour_name = self.under_camera(entry.text("imageTopicName", "rgb/image_raw"), base)
        info_name = self.under_camera(entry.text("cameraInfoTopicName", "rgb/camera_info"), base)
        self._colour = ColourTopics(colour_name, [info_name])
        self._depth = topic("depthImageTopicName", "depth/image_raw", Image)
        self._depth_info = topic("depthImageCameraInfoTopicName", "depth/camera_info", CameraInfo)
        self._points = topic("pointCloudTopicName", "depth/points", PointCloud2)
        self.topics = [*self._colour.all, self._depth, self._depth_info, self._points, self.rate_setting(base)]
        self._cloud = Cloud(pinhole, self._camera.lens and self._camera.lens.rays)
        self._noise = Noise(self._camera.noise) if self._camera.noise else None
        distortion = self._camera.distortion
        self._info = convert.camera_info(pinhole, entry.number(entry.plugin, "hackBaseline", 0.0), distortion)
        self._plain_info = convert.camera_info(pinhole, 0.0, distortion)

    def publish(self, time_s, link_pose, draw):
        points = self._points.has_listeners
        want_colour, want_depth = points or self._colour.want_picture, points or self._depth.has_listeners
        picture = depth = None
        if want_colour or want_depth:
            picture, depth = self._camera.view(link_pose, draw, want_colour, want_depth)
        if want_colour and self._noise:
            picture = self._noise.add(picture)
        if want_depth:
            depth = within(depth, self._nearest, self._furthest)
        self._colour.publish(time_s, self._frame, picture, self._camera.encoding, self._plain_info)
        if self._depth_info.has_listeners:
            self._depth_info.publish(convert.header(self._info, time_s, self._frame))
        if depth is not None and self._depth.has_listeners:
            values = millimetres(depth) if self._in_millimetres else depth
            self._depth.publish(convert.header(convert.depth_image(values), time_s, self._frame))
        if points:
            found = self._cloud.points(depth, picture)
            self._points.publish(convert.header(convert.point_cloud(found), time_s, self._frame))
