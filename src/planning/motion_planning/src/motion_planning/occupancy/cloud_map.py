# SPDX-License-Identifier: BSD-3-Clause
"""The points of a cloud as obstacles, without a memory of what was seen before."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.occupancy import kernels
from motion_planning.occupancy.occupancy_map import OccupancyMap, parts

if TYPE_CHECKING:
    from motion_planning.occupancy.mask import Mask
    from motion_planning.occupancy.occupancy_map import SensorView
    from motion_planning.shapes import Octree

# Room in the table of cells for each point: it must not be full.
_ROOM = 2


class CloudMap(OccupancyMap):
    """Cubes around the points that each source sees now: the next view of a source replaces its cubes. What is hidden
    from the camera for a moment is no obstacle then. Not thread-safe."""

    def clear(self) -> None:
        """Remove all cells."""
        super().clear()
        self._of_sources: dict[str, np.ndarray] = {}

    def see(self, view: SensorView, mask: Mask, source: str = "") -> tuple[bool, np.ndarray]:
        """Put a SensorView in the place of the one that the ``source`` had before; points in the Mask are not
        obstacles.

        Returns (whether the cells have changed, (n,) bool: points outside of the mask, or too far).
        """
        points = np.ascontiguousarray(view.points, dtype=np.float32)
        codes, outside = np.empty(len(points), np.int64), np.empty(len(points), np.bool_)
        table = np.full(1 << max(4, (_ROOM * len(points)).bit_length()), -1, np.int64)
        in_map = np.linalg.solve(view.map, view.sensor)
        count = kernels.fills(points, (parts(view.sensor), parts(in_map)), mask.arrays,
                              (self.resolution, float(view.max_range)), table, codes, outside)
        found = np.sort(codes[:count])
        before = self._of_sources.get(source)
        changed = before is None or not np.array_equal(found, before)
        self._of_sources[source] = found
        if changed:
            self._codes = np.unique(np.concatenate([*self._of_sources.values()]))
            self._odds = np.zeros(len(self._codes))
        return changed, outside

    def take(self, octree: Octree | None) -> None:
        """As OccupancyMap's, until the next view."""
        super().take(octree)
        self._of_sources = {}
