# SPDX-License-Identifier: BSD-3-Clause
"""Processing of pictures before they are published, and points from depth. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sensor_renderer.pinhole import Pinhole

# Size of the noise table, which is made once and shifted for each picture.
_NOISE_LENGTH = 1 << 20
_BYTES = {"rgb8": 3, "bgr8": 3, "mono8": 1, "bgra8": 4}


class Noise:
    """Normal noise on every value of a picture."""

    def __init__(self, deviation: float, mean: float = 0.0, seed: int = 0) -> None:
        """``deviation``: standard deviation, and ``mean``, 1.0 being full brightness."""
        self._random = np.random.default_rng(seed)
        values = self._random.normal(255.0 * mean, 255.0 * deviation, _NOISE_LENGTH)
        self._values = np.round(values).astype(np.int16)

    def add(self, picture: np.ndarray) -> np.ndarray:
        """The picture (uint8) with noise."""
        start = int(self._random.integers(_NOISE_LENGTH))
        noise = np.resize(np.roll(self._values, start)[:picture.size], picture.size).reshape(picture.shape)
        return np.clip(picture + noise, 0, 255).astype(np.uint8)


def encoded(picture: np.ndarray, encoding: str) -> tuple[bytes, int]:
    """The bytes of a picture (height, width, 3) of red, green, blue in ROS's ``encoding``, and the bytes of a row."""
    if encoding != "mono8" and not (encoding == "rgb8" and picture.flags.c_contiguous):
        ordered = np.full((*picture.shape[:2], _BYTES[encoding]), 255, dtype=np.uint8)
        for k in range(3):  # at once it takes many times as long
            ordered[:, :, k] = picture[:, :, k if encoding == "rgb8" else 2 - k]
        picture = ordered
    elif encoding == "mono8":
        # ITU-R BT.601's weights, in 256ths.
        picture = ((picture @ np.array([77, 150, 29], dtype=np.uint32)) >> 8).astype(np.uint8)
    return np.ascontiguousarray(picture).tobytes(), picture.shape[1] * _BYTES[encoding]


def within(depth: np.ndarray, nearest: float, furthest: float) -> np.ndarray:
    """``depth`` (height, width) with NaN for values nearer or further than these limits [m]."""
    with np.errstate(invalid="ignore"):
        return np.where((depth >= nearest) & (depth <= furthest), depth, np.float32(np.nan))


def millimetres(depth: np.ndarray) -> np.ndarray:
    """``depth`` [m] as uint16 [mm]; 0 where there is none, or where it is too large for uint16."""
    with np.errstate(invalid="ignore"):
        rounded = np.round(depth * 1000.0)
        return np.where(rounded < 65536.0, rounded, 0.0).astype(np.uint16)


class Cloud:
    """Coloured points of one camera: rows of x y z [m, optical frame] and the colour, packed as PCL reads it."""

    POINT_BYTES = 16

    def __init__(self, pinhole: Pinhole, rays: tuple[np.ndarray, np.ndarray] | None = None) -> None:
        """``rays``: x / z and y / z (height, width) of the pixels of a lens that distorts; without, the pinhole's."""
        if rays is not None:
            self._columns, self._rows = rays
            return
        columns = (np.arange(pinhole.width, dtype=np.float32) - pinhole.cx) / pinhole.fx
        rows = (np.arange(pinhole.height, dtype=np.float32) - pinhole.cy) / pinhole.fy
        self._columns, self._rows = columns.astype(np.float32)[None, :], rows.astype(np.float32)[:, None]

    def points(self, depth: np.ndarray, picture: np.ndarray) -> np.ndarray:
        """float32 (height, width, 4) of ``depth`` (height, width) and ``picture`` (height, width, 3) in red, green,
        blue; NaN where depth is."""
        found = np.empty((*depth.shape, 4), dtype=np.float32)
        np.multiply(depth, self._columns, out=found[:, :, 0])
        np.multiply(depth, self._rows, out=found[:, :, 1])
        found[:, :, 2] = depth
        colour = found.view(np.uint8).reshape(*depth.shape, 16)
        for k in range(3):
            colour[:, :, 12 + k] = picture[:, :, 2 - k]
        colour[:, :, 15] = 0
        return found
