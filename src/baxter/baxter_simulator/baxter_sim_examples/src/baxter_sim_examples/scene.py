# SPDX-License-Identifier: BSD-3-Clause
"""A block on the cafe table, in front of Baxter: made from a trial's seed. Free of ROS."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baxter_model import BASE_HEIGHT_M

from .pick_and_place import Spot, start_angles

TABLE_XY_M = (1.0, 0.1)  # middle of the table, in `base`
TABLE_TOP_M = 0.775  # above the floor
TABLE_SIZE_M = 0.913  # of its square top
BLOCK_SIZE_M = 0.04
# Where the left arm takes and puts blocks: x and y [m] in `base`.
NEAREST_M, FARTHEST_M = (0.60, -0.05), (0.75, 0.35)
# What an arm that looks is told: the middle of that area, and roughly the table's height [m], in `base`.
MIDDLE_M = ((NEAREST_M[0] + FARTHEST_M[0]) / 2.0, (NEAREST_M[1] + FARTHEST_M[1]) / 2.0)
ABOUT_M = TABLE_TOP_M - BASE_HEIGHT_M + 0.02
APART_M = 0.10  # source and target at least
MASSES_KG = (0.05, 0.3)
FRICTIONS = (0.4, 1.0)
START_SPREAD_RAD = 0.25

_BLOCK = """<robot name="block">
  <link name="block">
    <inertial>
      <mass value="%(mass)g"/>
      <inertia ixx="%(inertia)g" iyy="%(inertia)g" izz="%(inertia)g" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <geometry><box size="%(size)g %(size)g %(size)g"/></geometry>
      <material name="wood"><color rgba="0.8 0.6 0.35 1"/></material>
    </visual>
    <collision><geometry><box size="%(size)g %(size)g %(size)g"/></geometry></collision>
  </link>
  <gazebo reference="block"><mu1>%(friction)g</mu1><mu2>%(friction)g</mu2></gazebo>
</robot>
"""


@dataclass(frozen=True)
class Trial:
    """One pick and place of the left arm. source, target: Spot; start: angles by joint name [rad]."""

    source: Spot
    target: Spot
    mass_kg: float
    friction: float
    start: dict[str, float]

    @classmethod
    def from_seed(cls, seed: int) -> Trial:
        """The trial that belongs to an integer, the same one each time."""
        random = np.random.default_rng(seed)
        source = _spot(random)
        target = _spot(random)
        while np.hypot(target.x - source.x, target.y - source.y) < APART_M:
            target = _spot(random)
        start = {name: float(angle + random.uniform(-START_SPREAD_RAD, START_SPREAD_RAD))
                 for name, angle in start_angles("left").items()}
        return cls(source, target, float(random.uniform(*MASSES_KG)), float(random.uniform(*FRICTIONS)), start)


def _spot(random):
    x, y = random.uniform(NEAREST_M, FARTHEST_M)
    return Spot(float(x), float(y), TABLE_TOP_M + BLOCK_SIZE_M / 2.0 - BASE_HEIGHT_M,
                float(random.uniform(-np.pi, np.pi)))


def block_urdf(mass_kg: float, friction: float) -> str:
    """The description of the block, URDF text."""
    inertia = mass_kg * BLOCK_SIZE_M**2 / 6.0
    return _BLOCK % {"size": BLOCK_SIZE_M, "mass": mass_kg, "inertia": inertia, "friction": friction}
