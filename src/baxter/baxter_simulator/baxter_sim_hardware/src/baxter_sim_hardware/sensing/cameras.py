# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's cameras: valid settings, which may be open together, the effect of controls on a picture.

A camera is an array of 1280 x 800 sensors. Every mode shows all of it, scaled, unless a window is requested: then the
picture is that part of the array, pixel by pixel. Half resolution joins four sensors to one, which halves the array
that a window is cut from. Without ROS.
"""

from __future__ import annotations

import errno
from typing import NamedTuple

import numpy as np

from baxter_sim_hardware.errors import BaxterHardwareError
from command_line.options import counted
from sensor_renderer.pinhole import Pinhole

ARRAY = (1280, 800)
MODES = ((1280, 800), (960, 600), (640, 400), (480, 300), (384, 240), (320, 200))
#: Highest rate, and the default rate of a request [Hz].
FASTEST_HZ, DEFAULT_HZ = 60.0, 25.0
AUTO = -1
EXPOSURE, GAIN, WHITE_R, WHITE_G, WHITE_B, WINDOW_X, WINDOW_Y, FLIP, MIRROR, HALF = range(100, 110)
#: Name and largest value of each control; -1 also means "automatic".
CONTROLS = {
    EXPOSURE: ("exposure", 100), GAIN: ("gain", 79), WHITE_R: ("white balance red", 4095),
    WHITE_G: ("white balance green", 4095), WHITE_B: ("white balance blue", 4095), WINDOW_X: ("window x", ARRAY[0]),
    WINDOW_Y: ("window y", ARRAY[1]), FLIP: ("flip", 1), MIRROR: ("mirror", 1), HALF: ("half resolution", 1)}
# Neutral values: the middle of the range; for gain, zero. Full gain doubles.
_NEUTRAL_EXPOSURE, _NEUTRAL_WHITE, _DOUBLING_GAIN = 50.0, 2048.0, 79.0


class CameraRefused(BaxterHardwareError):
    """A request that a camera cannot follow. ``code`` is the errno of the service's answer."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


class CaptureSettings(NamedTuple):
    """Settings of an open camera: size [pixels], rate [Hz], and ``controls``, {id: value}; those left out are
    automatic."""

    width: int
    height: int
    rate: float
    controls: dict

    def checked(self) -> CaptureSettings:
        """These settings with a rate; raises :class:`CameraRefused` for impossible settings."""
        if (self.width, self.height) not in MODES:
            raise CameraRefused(errno.EINVAL, "%d x %d is not a resolution of this camera; choose from %s"
                                % (self.width, self.height, ", ".join("%d x %d" % mode for mode in MODES)))
        rate = self.rate or DEFAULT_HZ
        if not 0.0 < rate <= FASTEST_HZ:
            raise CameraRefused(errno.EINVAL, "%g pictures a second are out of range; expected more than 0, at most %g"
                                % (rate, FASTEST_HZ))
        for number, value in self.controls.items():
            if number not in CONTROLS:
                raise CameraRefused(errno.EINVAL, "camera control %d is not known; known are %s" % (
                    number, ", ".join("%d %s" % (key, name) for key, (name, _) in CONTROLS.items())))
            name, most = CONTROLS[number]
            if not AUTO <= value <= most:
                raise CameraRefused(errno.EINVAL, "%s of %d is out of range; expected 0 to %d, or -1 for automatic"
                                    % (name, value, most))
        settings = self._replace(rate=rate)
        x, y = settings.window or (0, 0)
        width, height = settings.array if settings.window else ARRAY
        if x + self.width > width or y + self.height > height:
            raise CameraRefused(errno.EINVAL, "a window of %d x %d at %d, %d does not fit the array of %d x %d"
                                % (self.width, self.height, x, y, width, height))
        return settings

    def control(self, number: int) -> int:
        """A control's value, -1 for automatic."""
        return self.controls.get(number, AUTO)

    @property
    def array(self) -> tuple[int, int]:
        """The array that a window is cut from [pixels]."""
        return (ARRAY[0] // 2, ARRAY[1] // 2) if self.control(HALF) == 1 else ARRAY

    @property
    def window(self) -> tuple[int, int] | None:
        """Corner of the picture in the array (x, y), or None for the whole array."""
        x, y = self.control(WINDOW_X), self.control(WINDOW_Y)
        return None if x == AUTO and y == AUTO else (max(x, 0), max(y, 0))

    def pinhole(self, focal: float, near: float, far: float) -> Pinhole:
        """The pinhole before :meth:`turned`. ``focal``: focal length of the full array [pixels]."""
        if self.window is None:
            focal, start, size = focal * self.width / ARRAY[0], (0, 0), (self.width, self.height)
        else:
            focal, start, size = focal * self.array[0] / ARRAY[0], self.window, self.array
        return Pinhole(self.width, self.height, focal, focal, (size[0] - 1) / 2.0 - start[0],
                       (size[1] - 1) / 2.0 - start[1], near, far)

    def turned(self, pinhole: Pinhole) -> Pinhole:
        """The pinhole of the picture after flip and mirror, in the same frame: a mirrored axis has a negative focal
        length, so that pixels still project along the right rays."""
        if self.control(MIRROR) == 1:
            pinhole = pinhole._replace(fx=-pinhole.fx, cx=pinhole.width - 1 - pinhole.cx)
        if self.control(FLIP) == 1:
            pinhole = pinhole._replace(fy=-pinhole.fy, cy=pinhole.height - 1 - pinhole.cy)
        return pinhole

    def developed(self, picture: np.ndarray) -> np.ndarray:
        """The picture (height, width, 3) of red, green, blue after exposure, gain, white balance, flip and mirror."""
        exposure, gain = self.control(EXPOSURE), self.control(GAIN)
        bright = (1.0 if exposure == AUTO else exposure / _NEUTRAL_EXPOSURE)
        bright *= 1.0 if gain == AUTO else 1.0 + gain / _DOUBLING_GAIN
        factors = [bright * (1.0 if white == AUTO else white / _NEUTRAL_WHITE)
                   for white in (self.control(number) for number in (WHITE_R, WHITE_G, WHITE_B))]
        if factors != [1.0, 1.0, 1.0]:
            levels = np.clip(np.arange(256)[:, None] * factors, 0, 255).astype(np.uint8)
            picture = np.stack([levels[:, k][picture[:, :, k]] for k in range(3)], axis=2)
        rows, columns = self.turns
        return picture[::rows, ::columns]

    @property
    def turns(self) -> tuple[int, int]:
        """(rows, columns): -1 where they run the other way after flip and mirror, else 1."""
        return (-1 if self.control(FLIP) == 1 else 1), (-1 if self.control(MIRROR) == 1 else 1)


class Rack:
    """The robot's cameras, and which of them are open."""

    def __init__(self, most_open: int) -> None:
        """``most_open``: largest number of powered cameras; the robot's wiring carries two of its three."""
        self._most_open = most_open
        self._names = []
        self.open = {}

    def add(self, name: str, settings: CaptureSettings | None) -> None:
        """Add a camera; open from the start with ``settings``, or closed for None."""
        self._names.append(name)
        if settings is not None and len(self.open) < self._most_open:
            self.open[name] = settings

    def remove(self, name: str) -> None:
        """Remove a camera."""
        self._names.remove(name)
        self.open.pop(name, None)

    def available(self) -> list[str]:
        """Names of the cameras that are open or could be opened now."""
        full = len(self.open) >= self._most_open
        return [name for name in self._names if name in self.open or not full]

    def open_camera(self, name: str, settings: CaptureSettings) -> CaptureSettings:
        """Open or reopen a camera; returns the :class:`CaptureSettings` in force. Raises :class:`CameraRefused`."""
        self._known(name)
        if name not in self.available():
            raise CameraRefused(errno.ENODEV, "%s has no power: %s are open, and only %s can be; close one"
                                % (name, " and ".join(self.open), counted(self._most_open, "camera")))
        self.open[name] = settings.checked()
        return self.open[name]

    def close_camera(self, name: str) -> None:
        """Close a camera. Raises :class:`CameraRefused`."""
        self._known(name)
        if name not in self.open:
            # Clients of the robot take only this code as "it was not open".
            raise CameraRefused(errno.EINVAL, "%s is closed already; open: %s"
                                % (name, ", ".join(self.open) or "none"))
        del self.open[name]

    def _known(self, name: str) -> None:
        if name not in self._names:
            raise CameraRefused(errno.ENODEV, "there is no camera '%s'; cameras: %s"
                                % (name, ", ".join(self._names) or "none"))
