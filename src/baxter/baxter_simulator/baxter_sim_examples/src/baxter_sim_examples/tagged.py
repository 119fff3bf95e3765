# SPDX-License-Identifier: BSD-3-Clause
"""Descriptions of things with a tag on their upper face. Free of ROS.

The black cells are thin boxes on a white face, so every program that draws descriptions shows the tag, with edges as
sharp as its pixels. They are matt, as printed paper: black paint and plastic mirror the sky.
"""
from __future__ import annotations

import numpy as np

from .scene import BLOCK_SIZE_M
from .tags import CELLS, pattern

#: The tag of the block to pick and its black border's side [m]: its white margin is one cell wide.
BLOCK_TAG = 3
BLOCK_TAG_M = BLOCK_SIZE_M * CELLS / (CELLS + 2)
# So high stand the cells above the face [m]: seen, but no more than print is.
_PRINT_M = 1e-4
_WHITE, _BLACK = "0.95 0.95 0.95 1", "0.03 0.03 0.03 1"

_VISUAL = """    <visual>
      <origin xyz="%.6g %.6g %.6g"/>
      <geometry><box size="%.6g %.6g %.6g"/></geometry>
      <material name="%s"><color rgba="%s"/><gloss value="0"/></material>
    </visual>
"""
_THING = """<robot name="%(name)s">
  <link name="%(name)s">
    <inertial>
      <mass value="%(mass)g"/>
      <inertia ixx="%(ixx)g" iyy="%(iyy)g" izz="%(izz)g" ixy="0" ixz="0" iyz="0"/>
    </inertial>
%(visuals)s    <collision><geometry><box size="%(x)g %(y)g %(z)g"/></geometry></collision>
  </link>
  <gazebo reference="%(name)s"><mu1>%(friction)g</mu1><mu2>%(friction)g</mu2></gazebo>
%(static)s</robot>
"""


def tagged_urdf(name: str, size: tuple[float, float, float], number: int, mass_kg: float = 0.1, friction: float = 0.7,
                static: bool = False) -> str:
    """URDF text of a white box of `size` (x, y, z) [m] about its own middle. Tag `number` fills its upper face, up to
    the white margin of one cell; the tag's x is the box's x."""
    x, y, z = size
    side = min(x, y) * CELLS / (CELLS + 2)
    visuals = [_VISUAL % (0, 0, 0, x, y, z, "tag_white", _WHITE)]
    for left, top, right, bottom in _rectangles(~pattern(number)):
        cell = side / CELLS
        visuals.append(_VISUAL % (
            cell * (left + right) / 2.0 - side / 2.0, side / 2.0 - cell * (top + bottom) / 2.0, z / 2.0,
            cell * (right - left), cell * (bottom - top), 2.0 * _PRINT_M, "tag_black", _BLACK))
    return _THING % {
        "name": name, "mass": mass_kg, "ixx": mass_kg * (y * y + z * z) / 12.0, "iyy": mass_kg * (x * x + z * z) / 12.0,
        "izz": mass_kg * (x * x + y * y) / 12.0, "visuals": "".join(visuals), "x": x, "y": y, "z": z,
        "friction": friction, "static": "  <gazebo><static>true</static></gazebo>\n" if static else ""}


def tagged_block_urdf(mass_kg: float, friction: float) -> str:
    """URDF text of the block to pick, with tag :data:`BLOCK_TAG` on its upper face."""
    return tagged_urdf("block", (BLOCK_SIZE_M, BLOCK_SIZE_M, BLOCK_SIZE_M), BLOCK_TAG, mass_kg, friction)


def _rectangles(cells):
    """(left, top, right, bottom) of rectangles that cover the True cells (rows, columns) once each: the longest row of
    cells from the first free one, and as many equal rows below it."""
    free, found = np.array(cells), []
    while free.any():
        top, left = (int(value) for value in np.argwhere(free)[0])
        right = left + int(np.argmin(np.append(free[top, left:], False)))
        bottom = top + int(np.argmin(np.append(free[top:, left:right].all(axis=1), False)))
        free[top:bottom, left:right] = False
        found.append((left, top, right, bottom))
    return found
