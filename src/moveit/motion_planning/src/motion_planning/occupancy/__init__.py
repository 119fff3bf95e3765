# SPDX-License-Identifier: BSD-3-Clause
"""What a depth camera sees, as occupied cubes."""
from motion_planning.occupancy.mask import Mask
from motion_planning.occupancy.occupancy_map import OccupancyMap, View

__all__ = ["Mask", "OccupancyMap", "View"]
