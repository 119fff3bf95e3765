# SPDX-License-Identifier: BSD-3-Clause
"""One camera with its shutter, its sensor and its noise. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.exposure import Exposure, ExposureSettings
from sensor_renderer.pictures import Noise

if TYPE_CHECKING:
    from sensor_renderer.moments import Moment
    from sensor_renderer.sensor_element import CameraElement


class CameraSensor:
    """Takes the pictures of one :class:`sensor_renderer.sensor_element.CameraElement`. ``exposure``: its
    :class:`sensor_renderer.exposure.ExposureSettings`, which may be replaced at any time."""

    def __init__(self, camera: CameraElement, seed: int = 0) -> None:
        """``seed``: a whole number from 0, of all noise."""
        self.camera = camera
        self.exposure = ExposureSettings()
        self._seed = seed
        self._sensor = Exposure(seed)
        self._noise = None
        self.set_noise(camera.noise_mean, camera.noise)

    def set_noise(self, mean: float, deviation: float) -> None:
        """Normal noise on every value of a picture; 1.0 is full brightness."""
        self._noise = Noise(deviation, mean, self._seed) if mean or deviation else None

    def taken(self, moment: Moment, colour: bool, depth: bool) -> tuple[Moment, np.ndarray | None, np.ndarray | None]:
        """(moment, picture, depth) of the exposure that ends at ``moment``: its middle, which the picture's stamp
        should say, and what :meth:`CameraElement.view` returns; depth is that of the middle."""
        settings = self.exposure
        seconds = settings.exposure_time
        middle = moment.at(moment.time_s - seconds / 2.0) if seconds else moment
        if not colour:
            return middle, None, self.camera.view(middle, False, True)[1] if depth else None
        count = 1 if not seconds or moment.is_still(seconds) else settings.blur_pictures
        if count == 1:
            picture, distance = self.camera.view(middle, True, depth)
            pictures = [picture]
        else:
            times = moment.time_s - seconds * (np.arange(count)[::-1] + 0.5) / count
            pictures = [self.camera.view(moment.at(float(time_s)), True, False)[0] for time_s in times]
            distance = self.camera.view(middle, False, True)[1] if depth else None
        picture = self._sensor.developed([taken for taken in pictures if taken is not None], settings, middle.time_s)
        noise = self._noise
        return middle, picture if noise is None else noise.add(picture), distance
