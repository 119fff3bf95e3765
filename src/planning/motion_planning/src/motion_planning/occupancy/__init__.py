# SPDX-License-Identifier: BSD-3-Clause
"""Occupied cells from the points of a depth camera."""
from motion_planning.occupancy.cloud_map import CloudMap
from motion_planning.occupancy.mask import Mask
from motion_planning.occupancy.occupancy_map import OccupancyMap, SensorView

__all__ = ["CloudMap", "Mask", "OccupancyMap", "SensorView"]
