# SPDX-License-Identifier: BSD-3-Clause
"""A map of occupied cells."""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.occupancy import kernels
from motion_planning.shapes import Octree
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from motion_planning.occupancy.kernels import Transform
    from motion_planning.occupancy.mask import Mask

# Log odds of octomap's sensor model (A. Hornung et al., OctoMap, 2013): of a point in a cell, of a ray that passes
# through it, and the greatest value of a cell. A cell at 0 is removed.
_HIT, _MISS, _MOST = 0.85, -0.4, 3.5
# Cells that can be taken from elsewhere: a tenth of a gigabyte.
_MAX_CELLS = 5e6


class SensorView(NamedTuple):
    """points (n, 3) in the sensor's frame, NaN for none; sensor, map (4, 4): both frames in the planning frame when the
    points were measured; max_range [m]: farther points are not entered, but their rays clear cells up to this range."""

    points: np.ndarray
    sensor: np.ndarray
    map: np.ndarray
    max_range: float


class OccupancyMap:
    """Occupied cubes of an octree that views fill and passing rays clear. Not thread-safe.

    A ray passes through a cell if a point behind the cell is seen.
    """

    def __init__(self, resolution: float) -> None:
        """resolution [m]: side of the smallest cube, above 0. Raises ValueError."""
        if not 0.0 < resolution < np.inf:
            raise ValueError("the resolution must be above 0, got %r m" % resolution)
        self.resolution = float(resolution)
        self.clear()

    def __len__(self) -> int:
        return len(self._codes)

    def clear(self) -> None:
        """Remove all cells."""
        self._codes, self._odds = np.empty(0, np.int64), np.empty(0)

    def see(self, view: SensorView, mask: Mask, source: str = "") -> tuple[bool, np.ndarray]:
        """Enter a :class:`SensorView` of any source; points in the :class:`Mask` clear cells as rays, but are not
        obstacles.

        Returns (whether the cells have changed, (n,) bool: points outside of the mask).
        """
        points = np.ascontiguousarray(view.points, dtype=np.float32)
        bins = np.full((kernels.HIGH, kernels.AROUND), np.inf, np.float32)
        codes, outside = np.empty(len(points), np.int64), np.empty(len(points), np.bool_)
        in_map = inverse(view.map) @ view.sensor
        count = kernels.sees(points, (parts(view.sensor), parts(in_map)), mask.arrays,
                             (self.resolution, float(view.max_range)), bins, codes, outside)
        hit = np.unique(codes[:count])
        missed, masked = np.empty(len(self._codes), np.bool_), np.empty(len(self._codes), np.bool_)
        kernels.misses(self._codes, (parts(view.map), parts(inverse(in_map))), mask.arrays, self.resolution, bins,
                       missed, masked)
        return self._enter(hit, missed, masked), outside

    def octree(self) -> Octree | None:
        """Return the cells as shapes.Octree in the map's frame, None if there are none."""
        if not len(self._codes):
            return None
        cells = np.stack([self._codes >> shift & 0xFFFF for shift in (0, 16, 32)], axis=1) - kernels.MIDDLE
        boxes = np.empty((len(cells), 4))
        boxes[:, :3], boxes[:, 3] = (cells + 0.5) * self.resolution, self.resolution
        return Octree(self.resolution, boxes)

    def take(self, octree: Octree | None) -> None:
        """Forget everything but the cubes of a shapes.Octree in the map's frame, or None; larger ones fill all cells in
        them. What a camera sees empties them again.

        Raises ValueError for another resolution, and for cubes that fill too many cells.
        """
        cells = np.empty((0, 3), np.int64)
        if octree is not None:
            if not np.isclose(octree.resolution, self.resolution, rtol=1e-6):
                raise ValueError("its cells are %g m wide, and those of the map %g m"
                                 % (octree.resolution, self.resolution))
            wide = np.rint(octree.boxes[:, 3] / self.resolution).astype(np.int64)
            count = float((wide.astype(float) ** 3).sum())
            if count > _MAX_CELLS:
                raise ValueError("it fills %.3g cells; at most %.3g can be kept" % (count, _MAX_CELLS))
            lowest = np.rint(octree.boxes[:, :3] / self.resolution - 0.5 * wide[:, None]).astype(np.int64)
            parts = [low + np.indices((n, n, n)).reshape(3, -1).T for low, n in zip(lowest, wide, strict=True)]
            cells = np.concatenate(parts) + kernels.MIDDLE
        self._codes = np.unique(cells[:, 0] | cells[:, 1] << 16 | cells[:, 2] << 32)
        self._odds = np.full(len(self._codes), _MOST)

    def _enter(self, hit: np.ndarray, missed: np.ndarray, masked: np.ndarray) -> bool:
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


def parts(pose: np.ndarray) -> Transform:
    """A pose (4, 4) as ``kernels`` take it: (rotation (3, 3), translation (3,))."""
    return np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3])
