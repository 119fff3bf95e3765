# SPDX-License-Identifier: BSD-3-Clause
"""Take a block from one spot of a table and put it on another: the sequence of steps, for any arm. Free of ROS.

Positions [m] are those of the frame between the finger tips, in `base`; orientations are quaternions x, y, z, w.
"""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from baxter_model import arm_angles

# Where the left arm begins [rad]; the vendor's demo begins there too. The right arm's is the mirror image.
START_ANGLES = {"s0": -0.08000397926829805, "s1": -0.9999781166910306, "e0": -1.189968899785275,
                "e1": 1.9400238130755056, "w0": 0.6699952259595108, "w1": 1.030009435085784,
                "w2": -0.4999997247485215}
# The other arm waits turned outwards [rad]: where it begins, its elbow would be within the distance at which a physical
# robot's collision avoidance stops both arms.
ASIDE_ANGLES = {**START_ANGLES, "s0": 0.7}

HOVER_M = 0.15  # above a spot: free to move sideways
NEAR_M = 0.05  # above a spot: from here on straight down and slowly, up to here straight and slowly
# In so many steps. The joints of a physical arm lag by different times, so on its way the tool leaves the straight
# line: by 11 mm in one motion of 50 mm, which is more than the room beside the fingers; by a part of a short step.
_STEPS = 4
_DOWN = tuple(NEAR_M * (_STEPS - step) / _STEPS for step in range(_STEPS + 1))
_UP = _DOWN[-2::-1]
_QUARTER = math.pi / 2.0


class PickingArm(Protocol):
    """An arm with its gripper; `ik` may raise anything, and motions return when they are done. Angles are by joint
    name [rad]."""

    name: str

    def ik(self, position: Sequence[float], orientation: Sequence[float],
           seed: Mapping[str, float]) -> dict[str, float]: ...

    def move_to(self, angles: dict[str, float]) -> dict[str, float]: ...

    def open(self) -> None: ...

    def close(self) -> None: ...

    def holds(self) -> bool: ...


class BlockLost(Exception):
    """There is no block between the fingers; the text says in which step that was found."""


@dataclass(frozen=True)
class Spot:
    """Present or desired centre of a block: x, y, z [m] in `base`, turned by yaw [rad] about z."""

    x: float
    y: float
    z: float
    yaw: float = 0.0


def start_angles(limb: str) -> dict[str, float]:
    """Angles by joint name [rad] in which an arm, "left" or "right", begins."""
    return arm_angles(limb, START_ANGLES)


def aside_angles(limb: str) -> dict[str, float]:
    """Angles by joint name [rad] in which an arm, "left" or "right", is out of the other one's way."""
    return arm_angles(limb, ASIDE_ANGLES)


def tool_down(yaw: float) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) of a tool that looks straight down, its fingers along y turned by `yaw` [rad]."""
    return math.cos(yaw / 2.0), math.sin(yaw / 2.0), 0.0, 0.0


def grip_yaw(yaw: float) -> float:
    """The turn in -45 to 45 degrees [rad] in which fingers meet two faces of a square block turned by `yaw`."""
    return yaw - _QUARTER * round(yaw / _QUARTER)


def pick_and_place(arm: PickingArm, source: Spot, target: Spot) -> None:
    """Carry the block from `source` to `target` (Spot). Raises BlockLost, and the arm's errors.

    The fingers keep their angle to the block, so that it arrives turned by the difference of the two spots' yaw, up to
    quarter turns.
    """
    arm.open()
    pose = arm.move_to(start_angles(arm.name))
    for height in (HOVER_M, *_DOWN):
        pose = _go(arm, source, height, pose)
    arm.close()
    _require_block(arm, "after the fingers closed")
    for height in (*_UP, HOVER_M):
        pose = _go(arm, source, height, pose)
    _require_block(arm, "after it was lifted")
    for height in (HOVER_M, *_DOWN):
        pose = _go(arm, target, height, pose)
    _require_block(arm, "on the way")
    arm.open()
    for height in (*_UP, HOVER_M):
        pose = _go(arm, target, height, pose)


def _go(arm, spot, height, seed):
    """Move to `height` [m] above a spot, staying near the angles `seed`; return the new angles."""
    angles = arm.ik((spot.x, spot.y, spot.z + height), tool_down(grip_yaw(spot.yaw)), seed)
    return arm.move_to(angles)


def _require_block(arm, when):
    if not arm.holds():
        raise BlockLost("nothing is between the fingers %s" % when)
