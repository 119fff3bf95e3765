# SPDX-License-Identifier: BSD-3-Clause
"""The settings of the robot's cameras. Free of ROS."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

# Pictures that the cameras can make, width and height in pixels; the largest is the whole sensor.
MODES = ((1280, 800), (960, 600), (640, 400), (480, 300), (384, 240), (320, 200))
# Value for "automatic".
AUTO = -1
# Defaults of a camera that was opened without settings.
DEFAULT_RESOLUTION = (320, 200)
DEFAULT_FPS = 20.0


@dataclass(frozen=True)
class CameraControl:
    """A camera control: its number in messages, its largest value, and its default."""

    id: int
    largest: int
    default: int


# The numbers are those of baxter_core_msgs/CameraControl.
CONTROLS = {
    "exposure": CameraControl(100, 100, AUTO),
    "gain": CameraControl(101, 79, AUTO),
    "white_balance_red": CameraControl(102, 4095, AUTO),
    "white_balance_green": CameraControl(103, 4095, AUTO),
    "white_balance_blue": CameraControl(104, 4095, AUTO),
    "window_x": CameraControl(105, MODES[0][0], AUTO),
    "window_y": CameraControl(106, MODES[0][1], AUTO),
    "flip": CameraControl(107, 1, 0),
    "mirror": CameraControl(108, 1, 0),
    "half_resolution": CameraControl(109, 1, 0),
}


@dataclass
class CameraSettings:
    """Settings of one camera; invalid values are refused with the valid range. `values` holds those that were set."""

    resolution: tuple = DEFAULT_RESOLUTION
    fps: float = DEFAULT_FPS
    values: dict = field(default_factory=dict)

    def get(self, name: str) -> int:
        """Return the control's value (int), its default if it was never set."""
        return self.values.get(name, CONTROLS[name].default)

    def set(self, name: str, value: float | bool) -> None:
        """Set the control to `value`. Raises ValueError."""
        lowest = min(CONTROLS[name].default, 0)
        number = _whole(value, "camera %s" % name.replace("_", " "))
        if not lowest <= number <= CONTROLS[name].largest:
            raise ValueError("camera %s must be from 0 to %d%s, got %r" % (
                name.replace("_", " "), CONTROLS[name].largest, ", or -1 for automatic" if lowest < 0 else "", value))
        self.values[name] = number

    def set_resolution(self, resolution: Sequence[int]) -> None:
        """Set width and height [pixels]. Raises AttributeError for something that is not a pair, ValueError."""
        if len(resolution) != 2:
            raise AttributeError("a camera's resolution is a pair (width, height), got %r" % (resolution,))
        if tuple(resolution) not in MODES:
            raise ValueError("a camera's resolution must be one of %s, got %dx%d" % (
                ", ".join("%dx%d" % mode for mode in MODES), *resolution))
        self.resolution = tuple(resolution)

    def set_fps(self, fps: float) -> None:
        """Set the pictures per second. Raises ValueError."""
        if not 0.0 < fps < float("inf"):
            raise ValueError("a camera's pictures per second must be above 0, got %r" % (fps,))
        self.fps = float(fps)

    def set_window(self, window: tuple[int, ...]) -> None:
        """Set the left upper corner of the part of the sensor that is shown, x and y [pixels].

        Raises AttributeError for something that is not a pair, ValueError.
        """
        if len(window) != 2:
            raise AttributeError("a camera's window is a pair (x, y), got %r" % (window,))
        largest = self.largest_window()
        corner = [_whole(value, "camera window") for value in window]
        if not all(0 <= value <= limit for value, limit in zip(corner, largest, strict=True)):
            raise ValueError("a camera's window must be from 0 0 to %d %d at this resolution, got %s %s"
                             % (*largest, *window))
        self.values["window_x"], self.values["window_y"] = corner

    def largest_window(self) -> tuple[int, int]:
        """Return the largest x and y of the window [pixels]: half resolution reads a sensor of half the size."""
        return tuple(whole // (1 + self.get("half_resolution")) - part
                     for whole, part in zip(MODES[0], self.resolution, strict=True))


def _whole(value: float | bool, what: str) -> int:
    number = int(value)
    if number != value:
        raise ValueError("%s must be a whole number, got %r" % (what, value))
    return number
