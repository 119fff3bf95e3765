# SPDX-License-Identifier: BSD-3-Clause
"""Find a block on a table in a camera's picture, and the table's height by a range sensor. Free of ROS."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from command_line.options import counted

from .pick_and_place import PickingArm, Spot, start_angles, tool_down
from .scene import BLOCK_SIZE_M
from .tagged import BLOCK_TAG, BLOCK_TAG_M
from .tags import find_tags

# Wood is reddish: its blue is less than this share of its red. The block's wood is lighter than what is around it.
_WOODEN, _LIGHTER = 0.7, 1.2
# "Around it": so many times the block's size.
_AROUND = 3.0
# Sides that a block may seem to have, as shares of its true side.
_SIDES = (0.75, 1.3)
# Range readings of which this many, or more, tell something [m].
_MIN_READINGS, _NOTHING_M = 5, 1.0
# A reading that is farther from the others is wrong, or is that of another surface [m].
_OUTLIER_M = 0.015


# From where the arm looks: above what it looks for, the tool pointing down; the second look from nearer [m].
_HIGH_M, _LOW_M = 0.22, 0.14
# So far beside the middle it feels for the table first, because the block may lie under one of the places [m].
_ASIDE_M = 0.08
# From there it looks again, by x and y beside the middle [m]: a finger may have hidden the block.
_ELSEWHERE_M = ((0.0, -0.12), (0.0, 0.12), (-0.1, 0.0))


class NotSeen(Exception):
    """The object is not there, or is not seen; the text says what was found."""


class LookingArm(PickingArm, Protocol):
    """The same with the hand's camera and range sensor; `feel()` -> (height of the sensor in `base` [m], its readings
    [m])."""

    def look(self) -> CameraView: ...

    def feel(self) -> tuple[float, list[float]]: ...


class CameraView(NamedTuple):
    """A picture and where it was taken: `picture` (height, width, 3) uint8 red, green, blue; `matrix` (3, 3) and
    `distortion` (n,), K and D of the camera; `pose` (4, 4) of the optical frame in `base` [m]."""

    picture: np.ndarray
    matrix: np.ndarray
    pose: np.ndarray
    distortion: tuple[float, ...] = ()

    def rays(self, pixels: npt.ArrayLike) -> np.ndarray:
        """x / z and y / z (n, 2), in the optical frame, of what pixels (n, 2) show."""
        pixels = np.asarray(pixels, dtype=float).reshape(-1, 1, 2)
        if not np.any(self.distortion):
            return (pixels.reshape(-1, 2) - self.matrix[:2, 2]) / np.diag(self.matrix)[:2]
        return cv2.undistortPoints(pixels, self.matrix, np.array(self.distortion, dtype=float)).reshape(-1, 2)

    def on_plane(self, pixels: np.ndarray, height: float) -> np.ndarray:
        """(n, 2) x and y [m] in `base` of the points at `height` [m] that pixels (n, 2) show."""
        rays = np.column_stack([self.rays(pixels), np.ones(len(pixels))]) @ self.pose[:3, :3].T
        lengths = (height - self.pose[2, 3]) / rays[:, 2]
        return self.pose[:2, 3] + lengths[:, None] * rays[:, :2]

    def scale(self, height: float) -> float:
        """Pixels for one metre at `height` [m] below or above the camera."""
        return abs(self.matrix[0, 0]) / max(abs(self.pose[2, 3] - height), 1e-3)


def find_block(view: CameraView, table_m: float, side_m: float = BLOCK_SIZE_M) -> Spot:
    """The Spot of the block on a table whose top is at height `table_m` [m] in `base`. Raises NotSeen.

    The block's upper face is the lighter patch of wood whose outline, seen at the height of that face, is a square of
    `side_m` [m].
    """
    top = table_m + side_m
    colours = cv2.GaussianBlur(view.picture, (3, 3), 0).astype(np.float32)
    red, wooden = colours[:, :, 0], (colours[:, :, 2] < _WOODEN * colours[:, :, 0]).astype(np.float32)
    window = (2 * int(0.5 * _AROUND * side_m * view.scale(top)) + 1,) * 2
    around = cv2.blur(red * wooden, window) / np.maximum(cv2.blur(wooden, window), 1e-3)
    light = ((red > _LIGHTER * around) & (wooden > 0.0)).astype(np.uint8)
    outlines, _ = cv2.findContours(light, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    seen, best = [], None
    for outline in outlines:
        if len(outline) < 8:
            continue
        place = view.on_plane(outline[:, 0, :], top)
        (x, y), sides, degrees = cv2.minAreaRect((1e3 * place).astype(np.float32))
        # The outline runs through the middles of pixels.
        sides = np.array(sides) / 1e3 + 1.0 / view.scale(top)
        seen.append("%.0f x %.0f mm" % tuple(1e3 * sides))
        share = sides / side_m
        if _SIDES[0] < share.min() and share.max() < _SIDES[1]:
            off = float(np.abs(share - 1.0).max())
            if best is None or off < best[0]:
                best = off, Spot(x / 1e3, y / 1e3, table_m + side_m / 2.0, float(np.radians(degrees)))
    if best is None:
        raise NotSeen("no block of %.0f mm is seen on the table; light patches: %s" % (
            1e3 * side_m, ", ".join(seen) or "none"))
    return best[1]


def table_height(sensor_m: float, readings: Sequence[float]) -> float:
    """Height [m] of what is below a range sensor that looks straight down from height `sensor_m` [m]: by the mean of
    those of its readings [m] that are near their median. Raises NotSeen where fewer than five say something."""
    heard = [reading for reading in readings if reading < _NOTHING_M]
    if len(heard) < _MIN_READINGS:
        raise NotSeen("the range sensor at %.2f m sees no table: %d of %s have an echo" % (
            sensor_m, len(heard), counted(len(readings), "reading")))
    heard = np.array(heard)
    return sensor_m - float(heard[np.abs(heard - np.median(heard)) < _OUTLIER_M].mean())


def locate(arm: LookingArm, middle: Sequence[float], about_m: float) -> Spot:
    """The Spot of the block that lies somewhere around `middle` (x, y) [m] in `base`, by looking and feeling.

    about_m: where the table's top is, roughly [m]. Raises NotSeen, and the arm's errors.
    """
    pose, heights = start_angles(arm.name), []
    for aside in (_ASIDE_M, 0.0):
        pose = _go(arm, (middle[0], middle[1] + aside, about_m + _HIGH_M), pose)
        heights.append(table_height(*arm.feel()))
    # What stands on a table is higher than the table. The lowest of noisy heights is too low, their mean is not.
    table_m = float(np.mean([height for height in heights if height < min(heights) + BLOCK_SIZE_M / 2.0]))
    spot, pose = _seen(arm, middle, table_m, pose, lambda view: find_block(view, table_m))
    _go(arm, (spot.x, spot.y, table_m + _LOW_M), pose)
    return find_block(arm.look(), table_m)


def find_tagged_block(view: CameraView, number: int = BLOCK_TAG, tag_m: float = BLOCK_TAG_M,
                      side_m: float = BLOCK_SIZE_M) -> Spot:
    """The Spot of the block of `side_m` [m] with tag `number`, of `tag_m` [m], on its upper face; the table's height
    need not be known. Raises NotSeen."""
    found = find_tags(view, tag_m)
    if number not in found:
        raise NotSeen("tag %d is not seen; tags in the picture: %s" % (
            number, ", ".join("%d" % other for other in sorted(found)) or "none"))
    pose = found[number]
    x, y, z = pose[:3, 3] - side_m / 2.0 * pose[:3, 2]
    return Spot(float(x), float(y), float(z), float(np.arctan2(pose[1, 0], pose[0, 0])))


def locate_tagged(arm: LookingArm, middle: Sequence[float], about_m: float) -> Spot:
    """As :func:`locate` for the block with a tag: the arm looks, and need not feel.

    From nearer, a finger may hide a corner of the tag: then the first look counts.
    """
    pose = _go(arm, (*middle, about_m + _HIGH_M), start_angles(arm.name))
    spot, pose = _seen(arm, middle, about_m, pose, find_tagged_block)
    _go(arm, (spot.x, spot.y, about_m + _LOW_M), pose)
    try:
        return find_tagged_block(arm.look())
    except NotSeen:
        return spot


def _seen(arm, middle, table_m, pose, find):
    """(Spot, the arm's angles) from the first place from which the block is seen; the arm is above the middle.

    find(view) -> Spot, raises NotSeen.
    """
    for x, y in _ELSEWHERE_M:
        try:
            return find(arm.look()), pose
        except NotSeen:
            pose = _go(arm, (middle[0] + x, middle[1] + y, table_m + _HIGH_M), pose)
    return find(arm.look()), pose


def _go(arm, place, seed):
    return arm.move_to(arm.ik(place, tool_down(0.0), seed))
