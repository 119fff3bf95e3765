# SPDX-License-Identifier: BSD-3-Clause
"""From the light of the ideal picture to the numbers of a physical sensor: exposure, gain, noise. ROS-free.

The model is the linear one of EMVA standard 1288 (release 3.1, section 2): a pixel collects electrons in proportion to
light and time, up to its full well; their number varies by its root (shot noise) and by that of reading it out; gain
multiplies all of it. Light is linear here, while pictures carry sRGB's tone curve (IEC 61966-2-1).
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: An exposure of this time [s] at 0 dB shows the scene as bright as the ideal picture.
NORMAL_S = 0.01
#: Longest exposure [s].
LONGEST_S = 0.1
#: What automatic gain aims at, mean brightness of the picture from 0 to 1, and its range [dB].
AIM, GAINS_DB = 0.45, (-24.0, 24.0)
# Share of the way to its aim that automatic gain goes with each picture.
_PACE = 0.5
_NOISE_LENGTH = 1 << 20
_ENCODED = 1 << 12


def _linear(level):
    return np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)


def _toned(light):
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1.0 / 2.4) - 0.055)


_LIGHT = _linear(np.arange(256) / 255.0).astype(np.float32)
_LEVEL = np.round(255.0 * _toned(np.arange(_ENCODED + 1) / _ENCODED)).astype(np.uint8)


@dataclass(frozen=True)
class ExposureSettings:
    """``exposure_time`` [s], 0 for a shutter that is infinitely fast and lets in the light of the ideal picture;
    ``gain`` [dB]; ``auto_exposure``: the gain follows the brightness of the pictures; ``blur_pictures``: number of
    moments of an exposure that are drawn; ``full_well``: electrons of a white pixel, 0 for no noise;
    ``read_noise``: standard deviation of reading it [electrons]."""

    exposure_time: float = 0.0
    gain: float = 0.0
    auto_exposure: bool = False
    blur_pictures: int = 8
    full_well: float = 0.0
    read_noise: float = 0.0

    @property
    def is_ideal(self) -> bool:
        """Whether pictures stay as they are drawn."""
        return not (self.exposure_time or self.gain or self.auto_exposure or self.full_well)


class Exposure:
    """The sensor of one camera."""

    def __init__(self, seed: int = 0) -> None:
        """``seed``: a whole number from 0. Noise depends on it and on the time of the picture."""
        self._seed = seed
        self._bank = None
        self._auto_db = 0.0

    def developed(self, pictures: Sequence[np.ndarray], settings: ExposureSettings, time_s: float) -> np.ndarray:
        """The picture (height, width, 3) uint8 that the sensor makes of ``pictures``, the same view at moments spread
        evenly over the exposure, at ``time_s`` [s]. ``settings``: :class:`ExposureSettings`."""
        if settings.is_ideal:
            return pictures[0]
        gain_db = self._auto_db if settings.auto_exposure else settings.gain
        share = settings.exposure_time / NORMAL_S if settings.exposure_time else 1.0
        gain = 10.0 ** (gain_db / 20.0)
        if len(pictures) == 1 and not settings.full_well:
            picture = _encoded(_LIGHT * np.float32(share * gain))[pictures[0]]
        else:
            light = sum(_LIGHT[picture] for picture in pictures) * np.float32(share / len(pictures))
            if settings.full_well:
                light = self._noisy(light, settings, time_s)
            picture = _encoded(light * np.float32(gain))
        if settings.auto_exposure:
            self._follow(picture)
        return picture

    def _noisy(self, light, settings, time_s):
        if self._bank is None:
            self._bank = np.random.default_rng(self._seed).standard_normal(_NOISE_LENGTH, dtype=np.float32)
        electrons = np.minimum(light, 1.0) * np.float32(settings.full_well)
        noise = np.sqrt(electrons + np.float32(settings.read_noise ** 2))
        noise *= from_bank(self._bank, light.shape, self._seed, time_s)
        return (electrons + noise) / np.float32(settings.full_well)

    def _follow(self, picture):
        """One step of the automatic gain, by the mean light of a ninth of the pixels."""
        mean = float(_LIGHT[picture[::3, ::3]].mean())
        step_db = 20.0 * np.log10(float(_linear(np.array(AIM))) / max(mean, 1e-4))
        self._auto_db = float(np.clip(self._auto_db + _PACE * step_db, *GAINS_DB))


def from_bank(bank: np.ndarray, shape: tuple[int, ...], seed: int, time_s: float) -> np.ndarray:
    """Values of ``bank`` (n,) in the shape of a picture, from a place that the seed and the time [s] decide."""
    start = int(np.random.default_rng([seed, round(1e6 * max(time_s, 0.0))]).integers(len(bank)))
    return np.resize(np.roll(bank, -start), shape)


def _encoded(light):
    """Levels (uint8) of ``light`` (float32), clipped to 0 to 1."""
    return _LEVEL[(np.clip(light, 0.0, 1.0) * np.float32(_ENCODED) + np.float32(0.5)).astype(np.int32)]
