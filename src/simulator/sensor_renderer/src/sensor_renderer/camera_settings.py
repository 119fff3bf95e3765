# SPDX-License-Identifier: BSD-3-Clause
"""Settings of a camera: from parameters at first, then through dynamic_reconfigure."""
from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import rospy

from loop_ros.reconfigure import Setting
from sensor_renderer.errors import SensorError
from sensor_renderer.exposure import GAINS_DB, LONGEST_S, ExposureSettings
from sensor_renderer.topics import ReconfigureServer

if TYPE_CHECKING:
    from sensor_renderer.camera_sensor import CameraSensor
    from sensor_renderer.topics import LearningTopics

#: Parameters below this name are for all cameras, those below a camera's own name for this one.
ALL_CAMERAS = "/sensor_renderer"
_MAX_BLUR_PICTURES, _MAX_ELECTRONS = 64, 1e6


def _camera_settings(noise):
    ideal = ExposureSettings()
    mean, deviation = noise
    return [
        Setting("exposure_time", ideal.exposure_time, 0.0, LONGEST_S,
                "[s]; moving things are blurred; 0: an ideal shutter"),
        Setting("gain", ideal.gain, *GAINS_DB, "[dB]; 6 doubles the light"),
        Setting("auto_exposure", ideal.auto_exposure, meaning="the gain follows the brightness of the pictures"),
        Setting("blur_pictures", ideal.blur_pictures, 1, _MAX_BLUR_PICTURES, "moments of an exposure that are drawn"),
        Setting("full_well", ideal.full_well, 0.0, _MAX_ELECTRONS, "electrons of a white pixel; 0: no shot noise"),
        Setting("read_noise", ideal.read_noise, 0.0, _MAX_ELECTRONS, "standard deviation [electrons], with full_well"),
        Setting("noise_mean", mean, -1.0, 1.0, "of normal noise on the values of pixels, of 1.0"),
        Setting("noise_stddev", deviation, 0.0, 1.0, "of normal noise on the values of pixels, of 1.0"),
        Setting("learning_topics", False, meaning="masks, depth and optical flow as topics"),
    ]


class ServedCameraSettings:
    """The settings of one camera; closed like a topic."""

    #: These topics need no picture.
    has_listeners = False

    def __init__(self, name: str, apply: Callable[[ServedCameraSettings], object],
                 noise: tuple[float, float] = (0.0, 0.0), more: Iterable[Setting] = ()) -> None:
        """``name``: the camera's in ROS; ``apply(self)`` is called now, and in a service's thread after each change;
        ``noise``: (mean, standard deviation) as the description has it; ``more``: further settings. Raises
        :class:`SensorError` for a parameter that is of no use."""
        given = {**_parameters(ALL_CAMERAS), **_parameters(name)}
        settings = [_given(name, setting, given) for setting in (*more, *_camera_settings(noise))]
        self._values: dict[str, Any] = {setting.name: setting.value for setting in settings}
        self._apply = apply
        apply(self)
        self._server = ReconfigureServer(name, settings, self._changed)

    def _changed(self, values):
        self._values = values
        self._apply(self)

    def value(self, name: str) -> Any:
        """The value of one setting."""
        return self._values[name]

    @property
    def exposure(self) -> ExposureSettings:
        """The :class:`sensor_renderer.exposure.ExposureSettings`."""
        return ExposureSettings(**{field.name: self._values[field.name]
                                   for field in dataclasses.fields(ExposureSettings)})

    def apply(self, camera: CameraSensor, learning: LearningTopics) -> None:
        """Pass the values on to a :class:`sensor_renderer.camera_sensor.CameraSensor` and to its LearningTopics."""
        camera.exposure = self.exposure
        camera.set_noise(self._values["noise_mean"], self._values["noise_stddev"])
        learning.open(self._values["learning_topics"])

    def close(self) -> None:
        """Unregister topics and service."""
        self._server.close()


def _parameters(name):
    found = rospy.get_param(name, {})
    return found if isinstance(found, dict) else {}


def _given(name, setting, given):
    """The setting, with the value of its parameter if it has one."""
    value = given.get(setting.name, setting.value)
    kinds = (bool,) if setting.kind is bool else (int, float)
    if not isinstance(value, kinds) or isinstance(value, bool) != (setting.kind is bool):
        raise SensorError("parameter %s of camera %s is %r, expected %s"
                          % (setting.name, name, value, "true or false" if setting.kind is bool else "a number"))
    if setting.kind is not bool and not setting.low <= value <= setting.high:
        raise SensorError("parameter %s of camera %s is %r, expected %g to %g"
                          % (setting.name, name, value, setting.low, setting.high))
    return dataclasses.replace(setting, value=setting.kind(value))
