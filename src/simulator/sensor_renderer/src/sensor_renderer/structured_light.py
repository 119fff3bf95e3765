# SPDX-License-Identifier: BSD-3-Clause
"""Depth as the first Kinect measures it: by the shift of a pattern that a projector beside the camera throws. ROS-free.

The random error of depth and its steps are those that Khoshelham and Oude Elberink measured ("Accuracy and resolution
of Kinect depth data for indoor mapping applications", Sensors 12, 2012, equations 6 and 11): the sensor gives a whole
number, the shift of the pattern in eighths of a pixel, with a standard deviation of half a step. One step is
2.85e-3 / m z^2 of depth, and the error grows with the square of the distance. That pixels near an edge take the depth
of either side follows Handa and others ("A benchmark for RGB-D visual odometry, 3D reconstruction and SLAM", ICRA
2014): each takes it from a place half a pixel around it.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.exposure import from_bank

if TYPE_CHECKING:
    from sensor_renderer.pinhole import Pinhole

#: Shift of the pattern [steps] at a distance of 1 m, and the standard deviation of the shift [steps].
STEPS_M, DEVIATION = 1.0 / 2.85e-3, 0.5
#: From the camera to the projector, to the right [m].
BASELINE_M = 0.075
#: Range in which the sensor measures [m].
RANGE_M = (0.5, 5.0)
# Standard deviation of the place in the picture [pixels of the Kinect], and the Kinect's focal length in these pixels.
_PLACE, _FOCAL = 0.5, 580.0
# Something hides the pattern from a point if it is nearer by more than this share: else surfaces would hide themselves.
_NEARER = 0.02
_BANK = 1 << 19


class StructuredLight:
    """The depth sensor of one camera."""

    def __init__(self, pinhole: Pinhole, seed: int = 0) -> None:
        """``pinhole``: of the depth picture; ``seed``: a whole number from 0. Noise depends on it and on the time."""
        self._pinhole, self._seed = pinhole, seed
        random = np.random.default_rng(seed)
        self._steps = (DEVIATION * random.standard_normal(_BANK)).astype(np.float32)
        places = np.round(_PLACE * pinhole.fx / _FOCAL * random.standard_normal((2, _BANK)))
        self._down, self._aside = places.astype(np.int32)

    def measured(self, depth: np.ndarray, time_s: float) -> np.ndarray:
        """``depth`` (height, width) [m], NaN for nothing, as the sensor measures it at ``time_s`` [s]: float32, NaN
        also in the projector's shadow and out of :data:`RANGE_M`."""
        lit = np.where(shadowed(depth, self._pinhole.fx), np.float32(np.nan), depth)
        height, width = depth.shape
        rows = np.arange(height, dtype=np.int32)[:, None] + from_bank(self._down, depth.shape, self._seed, time_s)
        columns = np.arange(width, dtype=np.int32) + from_bank(self._aside, depth.shape, self._seed, time_s)
        places = np.clip(rows, 0, height - 1) * width + np.clip(columns, 0, width - 1)
        found = np.where(np.isnan(lit), lit, lit.ravel()[places])
        shift = np.round(np.float32(STEPS_M) / found + from_bank(self._steps, depth.shape, self._seed, time_s))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.float32(STEPS_M) / shift
            return np.where((found >= RANGE_M[0]) & (found <= RANGE_M[1]), found, np.float32(np.nan))


def shadowed(depth: np.ndarray, focal_px: float) -> np.ndarray:
    """Where something else is between the projector and what ``depth`` (height, width) [m] shows; bool.

    ``focal_px``: focal length [pixels]. Each row of the picture is drawn as the projector sees it, with the nearest
    surface in front; what is farther away there is in shadow.
    """
    height, width = depth.shape
    far = np.nan_to_num(depth, nan=np.inf)
    seen_at = np.arange(width, dtype=np.float32) - np.float32(focal_px * BASELINE_M) / far
    cells = np.floor(seen_at).astype(np.int32)
    inside = (cells >= 0) & (cells < width - 1)
    # Neighbours in the picture may be two cells apart there: each fills the cells on both sides of its place.
    at = np.arange(height, dtype=np.int32)[:, None] * width + np.where(inside, cells, 0)
    nearest = np.full(height * width, np.inf, dtype=np.float32)
    for cell in (at, at + 1):
        np.minimum.at(nearest, cell[inside], far[inside])
    nearest = nearest.reshape(height, width)
    behind = np.minimum(nearest.ravel()[at], nearest.ravel()[at + 1]) < (1.0 - _NEARER) * far
    return inside & behind & np.isfinite(far)
