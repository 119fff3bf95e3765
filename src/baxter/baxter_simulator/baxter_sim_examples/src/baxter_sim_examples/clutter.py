# SPDX-License-Identifier: BSD-3-Clause
"""A block among other things on the table: what a seed decides, and how the block can be grasped and put down.
Free of ROS."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .pick_and_place import Spot, grip_yaw
from .scene import BASE_HEIGHT_M, BLOCK_SIZE_M, TABLE_TOP_M, Trial

THINGS = 9
# Where the things stand: x and y of their middles [m] in `base`.
_NEAREST_M, _FARTHEST_M = (0.55, -0.20), (0.90, 0.48)
_WIDTHS_M, _HEIGHTS_M, _MASSES_KG = (0.04, 0.08), (0.06, 0.22), (0.1, 0.4)
# Free between a thing and whatever stands beside it; the fingers reach in there.
_GAP_M = 0.02
# How far the hand may lean [rad] while its fingers stay along faces of the block.
_LEANS_RAD = (0.0, *(sign * lean for lean in (0.1, 0.2, 0.35, 0.5, 0.65) for sign in (1, -1)))
# What the planner is told of is larger by this to all sides [m]: its paths lead past things at next to no distance
# (0.2 mm and more), and joints that move leave their path by up to 10 mrad when a command comes late.
_MARGIN_M = 0.005
# Leans that differ by less are the same [rad].
_SAME_LEAN_RAD = 0.05
# A grasp or place loses this much quality for each radian it leans or turns away from where the arm is at ease.
_PER_LEAN, _PER_TURN = 0.5, 0.1
# The block is let go from so high above the table [m].
_DROP_M = 0.002

_THING = """<robot name="%(name)s">
  <link name="%(name)s">
    <inertial>
      <mass value="%(mass)g"/>
      <inertia ixx="%(inertia)g" iyy="%(inertia)g" izz="%(inertia)g" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <geometry>%(geometry)s</geometry>
      <material name="grey"><color rgba="0.5 0.55 0.6 1"/></material>
    </visual>
    <collision><geometry>%(geometry)s</geometry></collision>
  </link>
</robot>
"""


@dataclass(frozen=True)
class ClutterItem:
    """Something that stands in the way. spot: of its middle; width, height [m]; round: a cylinder, else a box."""

    name: str
    spot: Spot
    width: float
    height: float
    mass_kg: float
    is_round: bool

    @property
    def radius(self) -> float:
        """Of the circle that it stands in [m]."""
        return 0.5 * self.width * (1.0 if self.is_round else math.sqrt(2.0))

    def with_margin(self) -> ClutterItem:
        """The ClutterItem as a planner should know it: larger to all sides."""
        return replace(self, width=self.width + 2.0 * _MARGIN_M, height=self.height + 2.0 * _MARGIN_M)

    def urdf(self) -> str:
        """Its description, URDF text."""
        geometry = '<cylinder radius="%g" length="%g"/>' % (0.5 * self.width, self.height) if self.is_round else \
            '<box size="%g %g %g"/>' % (self.width, self.width, self.height)
        inertia = self.mass_kg * (self.width**2 + self.height**2) / 12.0
        return _THING % {"name": self.name, "mass": self.mass_kg, "inertia": inertia, "geometry": geometry}


@dataclass(frozen=True)
class Grasp:
    """How a hand comes to the block, or where it lets it go. position [m] of the frame between the finger tips in
    `base`, orientation (x, y, z, w); it comes along its own z axis. quality: the best are tried first."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]
    quality: float


def clutter(seed: int) -> list[ClutterItem]:
    """The things of a seed: a list that stands clear of the block, its target, and of each other."""
    trial, random = Trial.from_seed(seed), np.random.default_rng((seed, THINGS))
    block = 0.5 * math.sqrt(2.0) * BLOCK_SIZE_M
    taken, found = [(trial.source, block), (trial.target, block)], []
    while len(found) < THINGS:
        thing = _thing("thing_%d" % len(found), random)
        if all(math.hypot(thing.spot.x - spot.x, thing.spot.y - spot.y) > thing.radius + radius + _GAP_M
               for spot, radius in taken):
            found.append(thing)
            taken.append((thing.spot, thing.radius))
    return found


def _thing(name, random):
    x, y = random.uniform(_NEAREST_M, _FARTHEST_M)
    width, height = random.uniform(*_WIDTHS_M), random.uniform(*_HEIGHTS_M)
    spot = Spot(float(x), float(y), TABLE_TOP_M - BASE_HEIGHT_M + 0.5 * float(height),
                float(random.uniform(-math.pi, math.pi)))
    return ClutterItem(name, spot, float(width), float(height), float(random.uniform(*_MASSES_KG)),
                       bool(random.integers(2)))


def grasps(spot: Spot) -> list[Grasp]:
    """The Grasps of a block at a Spot: fingers along either pair of its upright faces, the hand upright or leaning."""
    found = []
    straight = grip_yaw(spot.yaw)
    for quarters in (0, 1, -1, 2):
        yaw = straight + quarters * math.pi / 2.0
        for lean in _LEANS_RAD:
            quality = 1.0 - _PER_LEAN * abs(lean) - _PER_TURN * abs(yaw)
            found.append(Grasp((spot.x, spot.y, spot.z), _down(yaw, lean), quality))
    return found


def lean_of(orientation: Sequence[float]) -> float:
    """The angle [rad] between straight down and the z axis of a hand with a quaternion x, y, z, w."""
    x, y, _, _ = orientation
    return math.acos(max(-1.0, min(1.0, 2.0 * (x * x + y * y) - 1.0)))


def held_otherwise(offered: Iterable[Grasp], orientation: Sequence[float]) -> list[Grasp]:
    """Those Grasps whose hand leans otherwise than one with a quaternion x, y, z, w.

    Only these put the block down with the hand elsewhere: a turn by quarters about the vertical is a landing's, too.
    """
    return [one for one in offered if abs(lean_of(one.orientation) - lean_of(orientation)) > _SAME_LEAN_RAD]


def landings(spot: Spot) -> list[Spot]:
    """Spots at which the block stands on its target, however it is turned by quarters, a hair above the table."""
    return [Spot(spot.x, spot.y, spot.z + _DROP_M, spot.yaw + quarters * math.pi / 2.0) for quarters in range(4)]


def _down(yaw, lean):
    """Quaternion (x, y, z, w) of a hand that looks down, its fingers along y turned by `yaw`, leaning about that."""
    # Half a turn about x, turned by yaw about the vertical; then the lean about the hand's own y.
    x, y = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    c, s = math.cos(lean / 2.0), math.sin(lean / 2.0)
    return x * c, y * c, x * s, -y * s
