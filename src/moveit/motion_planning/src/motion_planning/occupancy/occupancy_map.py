# SPDX-License-Identifier: BSD-3-Clause
"""Cells that something was seen in."""
from typing import NamedTuple

import numpy as np

from motion_planning.occupancy import kernels
from motion_planning.shapes import Octree
from urdf_model.transforms import inverse

# Log odds of octomap's sensor model (A. Hornung et al., OctoMap, 2013): of a point in a cell, of a ray that passes
# through it, and the most that a cell can have. At 0 a cell is forgotten.
_HIT, _MISS, _MOST = 0.85, -0.4, 3.5


class View(NamedTuple):
    """points (n, 3) in the sensor's frame, NaN for none; sensor, map (4, 4): both frames in the planning frame when the
    points were measured; max_range [m]: what is farther away is not entered, but rays up to there clear cells."""

    points: np.ndarray
    sensor: np.ndarray
    map: np.ndarray
    max_range: float


class OccupancyMap:
    """Occupied cubes of an octree that is filled by views and emptied by rays that pass through. Not for two threads at
    once.

    A ray passes through a cell where a point is seen behind it.
    """

    def __init__(self, resolution):
        """resolution [m]: side of the smallest cube, above 0. Raises ValueError."""
        if not 0.0 < resolution < np.inf:
            raise ValueError("the resolution must be above 0, got %r m" % resolution)
        self.resolution = float(resolution)
        self.clear()

    def __len__(self):
        return len(self._codes)

    def clear(self):
        """Forget everything."""
        self._codes, self._odds = np.empty(0, np.int64), np.empty(0)

    def see(self, view, mask):
        """Enter a :class:`View`; points in the :class:`Mask` are rays, but no obstacles.

        Returns (whether the cells have changed, (n,) bool: points outside of the mask).
        """
        points = np.ascontiguousarray(view.points, dtype=np.float32)
        bins = np.full((kernels.HIGH, kernels.AROUND), np.inf, np.float32)
        codes, outside = np.empty(len(points), np.int64), np.empty(len(points), np.bool_)
        in_map = inverse(view.map) @ view.sensor
        count = kernels.sees(points, (_parts(view.sensor), _parts(in_map)), mask.arrays,
                             (self.resolution, float(view.max_range)), bins, codes, outside)
        hit = np.unique(codes[:count])
        missed, masked = np.empty(len(self._codes), np.bool_), np.empty(len(self._codes), np.bool_)
        kernels.misses(self._codes, (_parts(view.map), _parts(inverse(in_map))), mask.arrays, self.resolution, bins,
                       missed, masked)
        return self._enter(hit, missed, masked), outside

    def octree(self):
        """Return the cells as shapes.Octree in the map's frame, None where there are none."""
        if not len(self._codes):
            return None
        cells = np.stack([self._codes >> shift & 0xFFFF for shift in (0, 16, 32)], axis=1) - kernels.MIDDLE
        boxes = np.empty((len(cells), 4))
        boxes[:, :3], boxes[:, 3] = (cells + 0.5) * self.resolution, self.resolution
        return Octree(self.resolution, boxes)

    def _enter(self, hit, missed, masked):
        where = np.searchsorted(self._codes, hit)
        known = np.zeros(len(hit), dtype=bool)
        inside = where < len(self._codes)
        known[inside] = self._codes[where[inside]] == hit[inside]
        missed[where[known]] = False
        odds = self._odds + np.where(missed, _MISS, 0.0)
        odds[where[known]] += _HIT
        kept = ~masked & (odds > 0.0)
        codes = np.concatenate([self._codes[kept], hit[~known]])
        odds = np.concatenate([np.minimum(odds[kept], _MOST), np.full((~known).sum(), _HIT)])
        changed = not (kept.all() and known.all())
        order = np.argsort(codes)
        self._codes, self._odds = codes[order], odds[order]
        return changed


def _parts(pose):
    return np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3])
