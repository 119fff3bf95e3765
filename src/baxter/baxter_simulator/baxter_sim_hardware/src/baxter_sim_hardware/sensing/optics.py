# SPDX-License-Identifier: BSD-3-Clause
"""Lens and sensor of a physical camera: what they make of the ideal camera's picture. Without ROS."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from baxter_sim_hardware import effects
from baxter_sim_hardware.individual import DRAWING, LensFactors

from .noise import generator

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from sensor_renderer.pinhole import Pinhole

# The noise of a picture is cut out of so many values more than it has, at a place that is drawn for each picture.
_SPARE = 1 << 16


class Optics:
    """One camera's lens and sensor.

    name: of the camera; chosen: effects that are on, as of `effects.chosen`; serial: of the robot; seed: integer from
    0, of the noise. Without the effect "noise", and for the robot 0, the picture stays the ideal one. Raises
    HardwareError.
    """

    def __init__(self, name: str, chosen: Collection[str], serial: int, seed: int) -> None:
        self._focal = self._noise = self._lens = None
        if "noise" in chosen or serial != DRAWING:
            rows = effects.read(effects.physical_robot())
            if serial != DRAWING:
                self._lens = LensFactors.of(serial, name, rows["serial"])
            if "noise" in chosen:
                self._focal = effects.positive(rows["senses"], "focal_length", "camera")
                self._noise = PictureNoise(rows["senses"], name, seed)

    def pinhole(self, ideal: Pinhole, array_focal: float) -> Pinhole:
        """The pinhole (of sensor_renderer) in place of `ideal`; array_focal: the ideal camera's focal length of the
        whole array [pixels]."""
        scale = ideal.fx / array_focal
        if self._focal is not None:
            ideal = ideal._replace(fx=scale * self._focal, fy=scale * self._focal)
        return ideal if self._lens is None else self._lens.before(ideal, scale)

    def seen(self, picture: np.ndarray, pinhole: Pinhole, time_s: float) -> np.ndarray:
        """The picture (height, width, 3) uint8 at time_s [s] in place of one without noise, of `pinhole`."""
        return picture if self._noise is None else self._noise.seen(picture, pinhole, time_s)


class PictureNoise:
    """Noise and vignetting of one camera's pictures.

    rows: section "senses" of `effects.read`; name: of the camera; seed: integer from 0. Raises HardwareError.
    """

    def __init__(self, rows: Mapping[str, Mapping[str, float]], name: str, seed: int) -> None:
        self._noise = effects.positive(rows, "picture_noise", "camera")
        self._dark = effects.positive(rows, "vignetting", "camera")
        self._name, self._seed = name, seed
        #: The pinhole of the last picture, its share of the light, and the values that noise is cut out of.
        self._last: tuple[Pinhole, np.ndarray, np.ndarray] | None = None

    def seen(self, picture: np.ndarray, pinhole: Pinhole, time_s: float) -> np.ndarray:
        """`picture`, (height, width, 3) uint8 of `pinhole`, as the sensor has it at time_s [s]; the same shape."""
        height, width = picture.shape[:2]
        if self._last is None or self._last[0] != pinhole:
            self._last = pinhole, self._vignette(pinhole), generator(self._seed, self._name, 0).standard_normal(
                picture.size + _SPARE, dtype=np.float32) * np.float32(self._noise)
        _, light, bank = self._last
        start = int(generator(self._seed, self._name, round(1e6 * time_s)).integers(1, _SPARE))
        noise = bank[start:start + picture.size].reshape(height, width, 3)
        return np.clip(picture * light + noise, 0.0, 255.0).astype(np.uint8)

    def _vignette(self, pinhole: Pinhole) -> np.ndarray:
        """(height, width, 1) share of the light, falling with the square of the sine of the angle to the axis."""
        x = (np.arange(pinhole.width) - pinhole.cx) / pinhole.fx
        y = (np.arange(pinhole.height) - pinhole.cy) / pinhole.fy
        tangent2 = x[None, :] ** 2 + y[:, None] ** 2
        return (1.0 - self._dark * tangent2 / (1.0 + tangent2)).astype(np.float32)[:, :, None]
