# SPDX-License-Identifier: BSD-3-Clause
"""The objects on the table for the programs that look: three coloured blocks and a board with a tag. Free of ROS."""
from __future__ import annotations

import math
from typing import NamedTuple

from .scene import BASE_HEIGHT_M, TABLE_TOP_M
from .tagged import tagged_urdf
from .tags import CELLS

#: Side of the coloured blocks, which are models of `model_files` [m].
COLOURED_M = 0.05
#: The board: its tag and size [m].
BOARD, BOARD_TAG = "tag_board", 5
BOARD_SIZE_M = (0.15, 0.15, 0.01)
BOARD_TAG_M = min(BOARD_SIZE_M[:2]) * CELLS / (CELLS + 2)


class PlacedModel(NamedTuple):
    """A model: its middle x, y, z [m] and its turn [rad], in `base`."""

    name: str
    x: float
    y: float
    z: float
    yaw: float

    @property
    def world(self) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
        """(x, y, z [m], quaternion x y z w) in the world, whose floor is at z = 0."""
        return (self.x, self.y, self.z + BASE_HEIGHT_M), (0.0, 0.0, math.sin(self.yaw / 2), math.cos(self.yaw / 2))


def _on_table(name, x, y, height, yaw):
    return PlacedModel(name, x, y, TABLE_TOP_M - BASE_HEIGHT_M + height / 2.0, yaw)


#: Models of `model_files` by name; where the untucked arms hide nothing from the Kinect.
COLOURED = (_on_table("red_block", 0.60, 0.11, COLOURED_M, 0.3), _on_table("green_block", 0.72, 0.05, COLOURED_M, -0.2),
            _on_table("blue_block", 0.62, -0.12, COLOURED_M, 0.6))
THE_BOARD = _on_table(BOARD, 0.85, -0.05, BOARD_SIZE_M[2], 0.4)


def board_urdf() -> str:
    """URDF text of the board, which stays where it lies."""
    return tagged_urdf(BOARD, BOARD_SIZE_M, BOARD_TAG, static=True)
