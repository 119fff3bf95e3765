# SPDX-License-Identifier: BSD-3-Clause
"""One of the robot's cameras: open it, close it, set it."""
from __future__ import annotations

import errno
import os
from collections.abc import Sequence

from baxter_core_msgs.msg import CameraControl
from baxter_core_msgs.msg import CameraSettings as CameraSettingsMessage
from baxter_core_msgs.srv import CloseCamera, ListCameras, OpenCamera

from . import startup
from .camera_settings import AUTO, CONTROLS, MODES, CameraSettings
from .services import THERE_S, call_service, wait_for_service

# So many of a physical robot's three cameras have power at a time; a simulated one may power them all.
MAX_POWERED = 2
# Mounted upside down behind the screen.
TURNED_CAMERA = "head_camera"


class UnknownCamera(AttributeError, ValueError):
    """A camera that the robot does not have, or that has no power."""


def list_cameras(timeout_s: float | None = None) -> list[str]:
    """List the names of the cameras that have power. Raises ServiceUnavailable (an OSError and a ROSException)."""
    startup.wait_for_start([])
    return list(call_service("/cameras/list", ListCameras, timeout_s=timeout_s).cameras)


class CameraController:
    """A camera by its name, such as "left_hand_camera", "right_hand_camera" or "head_camera".

    Assigning to a property opens the camera again with the new setting. Settings that were not assigned are the
    camera's defaults: 320x200 at 20 pictures per second, everything else automatic or off.
    Raises ServiceUnavailable (an OSError and a ROSException) if the robot has no cameras, UnknownCamera (an
    AttributeError and a ValueError) for a camera that is not on the robot's list, OSError if the camera refuses,
    rospy.ROSInitException before rospy.init_node.
    """

    MODES = list(MODES)
    CONTROL_AUTO = AUTO

    def __init__(self, name: str) -> None:
        self._id = name
        names = list_cameras()
        if name not in names:
            more = "" if len(names) > MAX_POWERED else (
                ". At most two of the three are on at a time; closing one may power another")
            raise UnknownCamera("there is no camera %r: those with power are %s%s"
                                % (name, ", ".join(map(repr, names)) or "none", more))
        for service in ("/cameras/open", "/cameras/close"):
            wait_for_service(service, THERE_S)
        self._settings = CameraSettings()

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height [pixels], one of MODES. Raises ValueError, AttributeError for something that is not a
        pair."""
        return self._settings.resolution

    @resolution.setter
    def resolution(self, resolution: Sequence[int]) -> None:
        self._settings.set_resolution(resolution)
        self.open()

    @property
    def fps(self) -> float:
        """Pictures per second. Raises ValueError."""
        return self._settings.fps

    @fps.setter
    def fps(self, fps: float) -> None:
        self._settings.set_fps(fps)
        self.open()

    @property
    def window(self) -> tuple[int, int]:
        """Left upper corner (x, y) [pixels] of the part of the sensor that is shown; (-1, -1) if never set.

        Raises AttributeError for something that is not a pair, ValueError for one outside the sensor.
        """
        return self._settings.get("window_x"), self._settings.get("window_y")

    @window.setter
    def window(self, window: tuple[int, ...]) -> None:
        self._settings.set_window(window)
        self.open()

    def open(self) -> None:
        """Open the camera with its present settings, or bring them to one that is open. Raises OSError."""
        values = dict(self._settings.values)
        if self._id == TURNED_CAMERA:
            values.update(flip=1, mirror=1)
        width, height = self._settings.resolution
        message = CameraSettingsMessage(width=width, height=height, fps=self._settings.fps, controls=[
            CameraControl(id=CONTROLS[name].id, value=value) for name, value in values.items()])
        self._check(call_service("/cameras/open", OpenCamera, self._id, message).err, "open")

    def close(self) -> None:
        """Close the camera; it does no harm if it is not open. Raises OSError."""
        error = call_service("/cameras/close", CloseCamera, self._id).err
        if error != errno.EINVAL:
            self._check(error, "close")

    def _check(self, error, verb: str) -> None:
        if error:
            raise OSError(error, "failed to %s the %s: %s" % (verb, self._id, os.strerror(abs(error))))


def _control_property(name: str, doc: str, kind: type = int) -> property:
    def read(self):
        return kind(self._settings.get(name))

    def write(self, value) -> None:
        self._settings.set(name, value)
        self.open()

    return property(read, write, doc=doc + " Raises ValueError.")


for _name, _doc in (("exposure", "Exposure, 0 to 100, -1 automatic."), ("gain", "Gain, 0 to 79, -1 automatic."),
                    ("white_balance_red", "Red share of the white balance, 0 to 4095, -1 automatic."),
                    ("white_balance_green", "Green share of the white balance, 0 to 4095, -1 automatic."),
                    ("white_balance_blue", "Blue share of the white balance, 0 to 4095, -1 automatic.")):
    setattr(CameraController, _name, _control_property(_name, _doc))
for _name, _doc in (("flip", "Whether the picture is turned upside down."),
                    ("mirror", "Whether the picture's left and right are swapped."),
                    ("half_resolution", "Whether the sensor is read at half its resolution.")):
    setattr(CameraController, _name, _control_property(_name, _doc, bool))
