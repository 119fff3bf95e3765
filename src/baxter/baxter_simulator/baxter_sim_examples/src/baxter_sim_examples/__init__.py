# SPDX-License-Identifier: BSD-3-Clause
"""Pick and place, without ROS: what to do in which order, and what the scene is made of."""
from .pick_and_place import START_ANGLES, BlockLost, Spot, pick_and_place, tool_down
from .scene import BASE_HEIGHT_M, BLOCK_SIZE_M, TABLE_TOP_M, TABLE_XY_M, Trial, block_urdf

__all__ = [
    "BASE_HEIGHT_M", "BLOCK_SIZE_M", "START_ANGLES", "TABLE_TOP_M", "TABLE_XY_M", "BlockLost", "Spot", "Trial",
    "block_urdf", "pick_and_place", "tool_down",
]
