# SPDX-License-Identifier: BSD-3-Clause
"""Publishers of pictures, and settings for clients of dynamic_reconfigure. Used from several threads."""
from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Empty, String

from loop_ros.reconfigure import Setting, SettingsServer
from sensor_renderer import convert
from sensor_renderer.labels import OpticalFlow

if TYPE_CHECKING:
    from genpy import Message

    from sensor_renderer.moments import Moment
    from sensor_renderer.sensor_element import CameraElement

# Pictures that can be asked for before the first of them is taken.
_MAX_TRIGGERS = 1000


class WatchedTopic:
    """A publisher that knows whether it has subscribers. A service's thread may close it at any time."""

    def __init__(self, name: str, message_class: type[Message], latch: bool = False) -> None:
        # A queue of one: a subscriber that has stopped reading loses pictures and delays nobody.
        self._publisher = rospy.Publisher(name, message_class, latch=latch, queue_size=1)
        self._lock = threading.Lock()

    @property
    def has_listeners(self) -> bool:
        """True while a subscriber is connected."""
        with self._lock:
            return self._publisher is not None and self._publisher.get_num_connections() > 0

    def publish(self, message: Message) -> None:
        """Send a message, unless the topic has been closed."""
        with self._lock:
            if self._publisher is not None:
                self._publisher.publish(message)

    def close(self) -> None:
        """Unregister the topic."""
        with self._lock:
            publisher, self._publisher = self._publisher, None
        if publisher is not None:
            publisher.unregister()


class Trigger:
    """Counts the std_msgs/Empty on a topic; closed like one."""

    #: It needs no picture.
    has_listeners = False

    def __init__(self, name: str) -> None:
        self.count = 0
        self._lock = threading.Lock()
        self._subscriber = rospy.Subscriber(name, Empty, self._add)

    def _add(self, _):
        with self._lock:
            self.count = min(self.count + 1, _MAX_TRIGGERS)

    def take(self) -> bool:
        """Whether there was a message that has not been taken; it is now."""
        with self._lock:
            self.count, had = max(self.count - 1, 0), self.count
        return had > 0

    def clear(self) -> None:
        """Forget the messages that have not been taken."""
        with self._lock:
            self.count = 0

    def close(self) -> None:
        """Unregister the topic."""
        self._subscriber.unregister()


class ReconfigureServer:
    """Settings for clients of dynamic_reconfigure; closed like a topic."""

    #: These topics need no picture.
    has_listeners = False

    def __init__(self, name: str, settings: Iterable[Setting], apply: Callable[[dict[str, Any]], object]) -> None:
        """As :class:`loop_ros.reconfigure.SettingsServer`; ``apply`` is called in a service's thread."""
        self._opened = []
        self._lock = threading.Lock()
        SettingsServer(self, name, settings, apply)

    def publisher(self, topic: str, msg_class: type[Message], latch: bool) -> rospy.Publisher:
        """For SettingsServer."""
        publisher = rospy.Publisher(topic, msg_class, latch=latch, queue_size=1)
        self._opened.append(publisher.unregister)
        return publisher

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> None:
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

    def close(self) -> None:
        """Unregister topics and service."""
        while self._opened:
            self._opened.pop()()


class ColourTopics:
    """Image, compressed image and camera_info of one colour camera."""

    def __init__(self, image_topic: str, info_topics: Iterable[str]) -> None:
        self.image = WatchedTopic(image_topic, Image)
        self.compressed = WatchedTopic(image_topic + "/compressed", CompressedImage)
        self.infos = [WatchedTopic(name, CameraInfo) for name in info_topics]
        self._quality = convert.JPEG_QUALITY
        settings = ReconfigureServer(image_topic + "/compressed", [
            Setting("jpeg_quality", self._quality, 1, 100, "of the pictures, in percent")], self._apply)
        self.all = [self.image, self.compressed, *self.infos, settings]

    def _apply(self, values):
        self._quality = values["jpeg_quality"]

    @property
    def want_picture(self) -> bool:
        """Whether a picture topic has subscribers."""
        return self.image.has_listeners or self.compressed.has_listeners

    def publish(self, time_s: float, frame: str, picture: np.ndarray | None, encoding: str, info: CameraInfo) -> None:
        """``picture`` may be None without subscribers."""
        for topic in self.infos:
            if topic.has_listeners:
                topic.publish(convert.header(info, time_s, frame))
        if picture is not None and self.image.has_listeners:
            self.image.publish(convert.header(convert.image(picture, encoding), time_s, frame))
        if picture is not None and self.compressed.has_listeners:
            self.compressed.publish(convert.header(convert.compressed_image(picture, self._quality), time_s, frame))


class LearningTopics:
    """Labels of a camera's pixels, for programs that learn: masks of classes and of models with their tables,
    depth, optical flow. They exist while they are open."""

    def __init__(self, folder: str) -> None:
        """``folder``: the camera's name in ROS."""
        self._folder = folder
        self._topics = {}
        self._sent = {}
        self._motion = OpticalFlow()

    def open(self, is_open: bool) -> None:
        """Open or close the topics; any thread may call it."""
        if is_open == bool(self._topics):
            return
        if not is_open:
            self.close()
            return
        self._sent, self._motion = {}, OpticalFlow()
        self._topics = {
            **{name: WatchedTopic("%s/%s" % (self._folder, name), Image)
               for name in ("semantic/image_raw", "instance/image_raw", "ideal_depth/image_raw", "flow/image_raw")},
            **{name: WatchedTopic("%s/%s" % (self._folder, name), String, latch=True)
               for name in ("semantic/labels", "instance/labels")}}

    def close(self) -> None:
        """Unregister the topics."""
        topics, self._topics = self._topics, {}
        for topic in topics.values():
            topic.close()

    @property
    def has_listeners(self) -> bool:
        """Whether one of the topics has a subscriber."""
        return any(topic.has_listeners for topic in list(self._topics.values()))

    def publish(self, moment: Moment, camera: CameraElement, frame: str, turned: tuple[int, int] = (1, 1)) -> None:
        """Publish the view of ``camera``, a CameraElement, at a Moment. ``turned``: -1 where rows or columns of the
        camera's pictures run the other way."""
        topics = dict(self._topics)
        wanted = {name for name, topic in topics.items() if topic.has_listeners}
        if not wanted:
            return
        labels = moment.labels
        for name, table in (("semantic/labels", labels.classes), ("instance/labels", labels.models)):
            if self._sent.get(name) != table:
                self._sent[name] = table
                topics[name].publish(String(json.dumps(table)))
        if not wanted - {"semantic/labels", "instance/labels"}:
            return
        numbers, links, depth = camera.identified(moment)
        classes, models = labels.masks(numbers, links)
        for name, values in (("semantic/image_raw", classes), ("instance/image_raw", models),
                             ("ideal_depth/image_raw", depth)):
            if name in wanted:
                topics[name].publish(convert.header(convert.values_image(values[::turned[0], ::turned[1]]),
                                                    moment.time_s, frame))
        if "flow/image_raw" in wanted:
            flow = self._motion.flow(camera, moment, numbers, links, depth)[::turned[0], ::turned[1]]
            flow = flow * np.array([turned[1], turned[0]], dtype=np.float32)
            topics["flow/image_raw"].publish(convert.header(convert.values_image(flow), moment.time_s, frame))
