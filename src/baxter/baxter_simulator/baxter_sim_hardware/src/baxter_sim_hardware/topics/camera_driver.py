# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's cameras in /sensor_renderer: topics of each camera, and the services that open and close them."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import rospy
from baxter_core_msgs.srv import (
    CloseCamera,
    CloseCameraResponse,
    ListCameras,
    ListCamerasResponse,
    OpenCamera,
    OpenCameraResponse,
)
from std_srvs.srv import Empty, EmptyResponse

from baxter_sim_hardware import effects, individual
from baxter_sim_hardware.errors import BaxterHardwareError
from baxter_sim_hardware.sensing.cameras import FLIP, MIRROR, CameraRefused, CaptureSettings, Rack
from baxter_sim_hardware.sensing.optics import Optics
from sensor_renderer import convert
from sensor_renderer.camera_sensor import CameraSensor
from sensor_renderer.camera_settings import ServedCameraSettings
from sensor_renderer.drivers import Driver
from sensor_renderer.errors import SensorError
from sensor_renderer.lens import Lens
from sensor_renderer.topics import ColourTopics, LearningTopics
from sim_time.pace import Pace

if TYPE_CHECKING:
    from collections.abc import Callable

    from baxter_core_msgs.srv import CloseCameraRequest, ListCamerasRequest, OpenCameraRequest
    from std_srvs.srv import EmptyRequest

    from sensor_renderer.moments import Moment
    from sensor_renderer.sensor_element import SensorEntry

# Two of the robot's three cameras can have power (baxter_interface 1.1.0).
_ROBOT_POWERS, _ALL = 2, 3
_PARAMETERS = "/baxter_sim_hardware/"
# State of the robot's cameras after its start: both hands' are open.
_ROBOT_MODE = (640, 400, 25.0)
_HEAD = "head_camera"
# The head's camera is mounted upside down; all clients request this.
_UPRIGHT = {FLIP: 1, MIRROR: 1}


class CameraServices:
    """``list``, ``open``, ``close`` and ``reset`` of all cameras in one namespace."""

    _by_namespace = {}

    @classmethod
    def of(cls, namespace: str) -> CameraServices:
        """The services of this namespace, made when first asked for."""
        if namespace not in cls._by_namespace:
            cls._by_namespace[namespace] = cls(namespace)
        return cls._by_namespace[namespace]

    def __init__(self, namespace: str) -> None:
        profile = rospy.get_param(_PARAMETERS + "profile", "sim")
        #: Whether the cameras start as on the physical robot, or as in the vendor's simulator.
        self.as_robot = profile == "robot"
        powered = rospy.get_param(_PARAMETERS + "powered_cameras", _ROBOT_POWERS if self.as_robot else _ALL)
        self._effects = rospy.get_param(_PARAMETERS + "effects", effects.ALL if self.as_robot else effects.NONE)
        self._rack = Rack(powered)
        self._drivers = {}
        self._namespace = namespace
        self._lock = threading.Lock()
        self._services = [rospy.Service("%s/%s" % (namespace, name), kind, handler) for name, kind, handler in (
            ("list", ListCameras, self._list), ("open", OpenCamera, self._open), ("close", CloseCamera, self._close),
            ("reset", Empty, self._reset))]

    def optics(self, name: str) -> Optics:
        """The `Optics` of a camera. Raises SensorError."""
        try:
            return Optics(name, effects.chosen(self._effects),
                          individual.checked(rospy.get_param(_PARAMETERS + "serial", individual.DRAWING)),
                          rospy.get_param("/gazebo/seed", 0))
        except BaxterHardwareError as error:
            raise SensorError("%s: %s" % (name, error)) from error

    def add(self, driver: BaxterCamera) -> None:
        """Add a camera."""
        with self._lock:
            self._drivers[driver.camera_name] = driver
            self._rack.add(driver.camera_name, driver.first_settings)
            driver.use(self._rack.open.get(driver.camera_name))

    def remove(self, driver: BaxterCamera) -> None:
        """Remove a camera; the services close with the last one."""
        with self._lock:
            self._drivers.pop(driver.camera_name)
            self._rack.remove(driver.camera_name)
            driver.use(None)
            if not self._drivers:
                for service in self._services:
                    service.shutdown("the cameras are gone")
                self._by_namespace.pop(self._namespace)

    def _list(self, _request: ListCamerasRequest) -> ListCamerasResponse:
        with self._lock:
            return ListCamerasResponse(self._rack.available())

    def _open(self, request: OpenCameraRequest) -> OpenCameraResponse:
        asked = request.settings
        settings = CaptureSettings(asked.width, asked.height, asked.fps,
                            {control.id: control.value for control in asked.controls})

        def do():
            held = self._rack.open_camera(request.name, settings)  # first of all refuses unknown names
            self._drivers[request.name].use(held)

        return OpenCameraResponse(self._code(do))

    def _close(self, request: CloseCameraRequest) -> CloseCameraResponse:
        def do():
            self._rack.close_camera(request.name)
            self._drivers[request.name].use(None)

        return CloseCameraResponse(self._code(do))

    def _reset(self, _request: EmptyRequest) -> EmptyResponse:
        with self._lock:
            for name in list(self._rack.open):
                self._rack.close_camera(name)
            for name, driver in self._drivers.items():
                self._rack.remove(name)
                self._rack.add(name, driver.first_settings)
                driver.use(self._rack.open.get(name))
        return EmptyResponse()

    def _code(self, do: Callable[[], None]) -> int:
        with self._lock:
            try:
                do()
            except CameraRefused as error:
                rospy.logerr("cameras: %s" % error)
                return error.code
        return 0


class BaxterCamera(Driver):
    """One of the robot's cameras, named as its sensor; ``<robotNamespace>`` is the namespace of the services."""

    def __init__(self, entry: SensorEntry) -> None:
        super().__init__(entry)
        camera = entry.cameras()[0]
        self.camera_name = entry.name
        self._camera = camera
        self._frame = entry.frame
        self._use = None
        self._learning = LearningTopics(self.name(self.camera_name))
        self._services = CameraServices.of(entry.namespace)
        self._optics = self._services.optics(self.camera_name)
        self._settings = ServedCameraSettings(self.name(self.camera_name), self._apply,
                                              (camera.noise_mean, camera.noise))
        pinhole = camera.pinhole
        controls = _UPRIGHT if self.camera_name == _HEAD else {}
        if self._services.as_robot:
            self._encoding = "bgra8"
            self.first_settings = None if self.camera_name == _HEAD else CaptureSettings(*_ROBOT_MODE, controls)
        else:
            # As the vendor's simulator: the description's own size, until a client opens the camera in another mode.
            self._encoding = camera.encoding
            self.first_settings = CaptureSettings(pinhole.width, pinhole.height, entry.rate, controls)
        self._services.add(self)

    def use(self, settings: CaptureSettings | None) -> None:
        """Open with ``settings``, or close for None."""
        if settings is None:
            old, self.topics, self._use = self.topics, [], None
            for topic in old:
                topic.close()
            return
        whole = pinhole = self._camera.pinhole
        if settings is not self.first_settings or self._services.as_robot:
            pinhole = settings.pinhole(whole.fx, whole.near, whole.far)
        pinhole = self._optics.pinhole(pinhole, whole.fx)
        topics = self._use[0] if self._use is not None else ColourTopics(
            self.name("%s/image" % self.camera_name),
            [self.name("%s/%s" % (self.camera_name, name)) for name in ("camera_info", "camera_info_std")])
        distortion = self._camera.distortion
        lens = Lens(pinhole, distortion) if any(distortion) else None
        sensor = CameraSensor(self._camera._replace(pinhole=pinhole, lens=lens), self.seed(self.camera_name))
        self._use = topics, settings, sensor, convert.camera_info(settings.turned(pinhole), 0.0, distortion)
        self._pace = Pace(settings.rate)
        self._apply(self._settings)
        self.topics = [*topics.all, self._learning]

    def _apply(self, settings: ServedCameraSettings) -> None:
        self.memory_s = settings.exposure.exposure_time
        use = self._use
        if use is not None:
            settings.apply(use[2], self._learning)

    def publish(self, moment: Moment) -> None:
        use = self._use
        if use is None:
            return  # closed by a client since the node asked
        topics, settings, sensor, info = use
        middle, picture, _ = sensor.taken(moment, topics.want_picture, False)
        if picture is not None:
            picture = settings.developed(self._optics.seen(picture, sensor.camera.pinhole, middle.time_s))
        topics.publish(middle.time_s, self._frame, picture, self._encoding, info)
        self._learning.publish(middle, sensor.camera, self._frame, settings.turns)

    def close(self) -> None:
        self._settings.close()
        self._services.remove(self)
