# SPDX-License-Identifier: BSD-3-Clause
"""Compiled loops over the points of clouds and the cells of a map.

A transform is (rotation (3, 3), translation (3,)). A mask is (balls (g, 4) centre and radius of each group, starts (g
+ 1,) of its solids, solids (s, 16): centre 3, rotation 9 (rows: the solid's axes), half sizes 3, kind). A cell's code
is x, y, z with 16 bits each, counted from the corner of the tree.
"""
from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from disk_cache.compiled import compiler

if TYPE_CHECKING:
    Transform = tuple[np.ndarray, np.ndarray]
    MaskArrays = tuple[np.ndarray, np.ndarray, np.ndarray]

#: Kinds of solids.
BOX, CYLINDER, BALL = 0, 1, 2
#: Directions of rays are sorted by angles of this size [rad].
BIN_RAD = 0.005
#: Bins of the angle from the y axis, and of the one about it.
HIGH, AROUND = int(math.pi / BIN_RAD) + 1, int(2.0 * math.pi / BIN_RAD) + 1
#: Distance of the tree's corner from its origin [cells].
MIDDLE = 1 << 15
# A ray passes through a cell if it comes nearer to its middle than this share of its side.
_INNER = 0.4
# Nearer points [m] are the camera's noise.
_NEAREST = 1e-3

compiled = compiler("motion_planning_occupancy", [Path(__file__)], nogil=True, error_model="numpy")


@compiled
def sees(points: np.ndarray, transforms: tuple[Transform, Transform], mask: MaskArrays, sizes: tuple[float, float],
         bins: np.ndarray, codes: np.ndarray, outside: np.ndarray) -> int:
    """Sort ``points`` (n, 3), float32 in the sensor's frame, NaN where there is none.

    transforms: (sensor to the mask's frame, sensor to the map's); sizes: (side of a cell, greatest range) [m].
    Fills bins (HIGH, AROUND) with the nearest range in each direction, codes (n,) with the cells of points that are
    near enough and not in the mask, and outside (n,) with whether a point is not in the mask. Returns the number of
    codes.
    """
    to_mask, to_map = transforms
    side, most = sizes
    count = 0
    for i in range(points.shape[0]):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        distance = math.sqrt(x * x + y * y + z * z)
        outside[i] = False
        if not (distance > _NEAREST and distance < math.inf):
            continue
        high, around = _bin(x, y, z, distance)
        bins[high, around] = min(bins[high, around], min(distance, most))
        a, b, c = _moved(to_mask, x, y, z)
        outside[i] = not inside(mask, a, b, c)
        if distance > most or not outside[i]:
            continue
        a, b, c = _moved(to_map, x, y, z)
        a, b, c = math.floor(a / side) + MIDDLE, math.floor(b / side) + MIDDLE, math.floor(c / side) + MIDDLE
        if min(a, b, c) < 0 or max(a, b, c) >= 2 * MIDDLE:
            continue
        codes[count] = int(a) | int(b) << 16 | int(c) << 32
        count += 1
    return count


@compiled
def fills(points: np.ndarray, transforms: tuple[Transform, Transform], mask: MaskArrays, sizes: tuple[float, float],
          table: np.ndarray, codes: np.ndarray, outside: np.ndarray) -> int:
    """Find the cells of ``points`` (n, 3), as ``sees`` does, but each once and without looking at rays.

    table (2**m,) of -1, for more codes than there are points near enough: where cells are looked up. outside (n,): as
    of ``sees``, but true for points that are too far to be entered. Returns the number of codes.
    """
    to_mask, to_map = transforms
    side, most = sizes
    count, last, square = 0, table.shape[0] - 1, most * most
    for i in range(points.shape[0]):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        distance = x * x + y * y + z * z
        outside[i] = distance > _NEAREST * _NEAREST and distance < math.inf
        if not (outside[i] and distance <= square):
            continue
        a, b, c = _moved(to_map, x, y, z)
        a, b, c = math.floor(a / side) + MIDDLE, math.floor(b / side) + MIDDLE, math.floor(c / side) + MIDDLE
        if min(a, b, c) < 0 or max(a, b, c) >= 2 * MIDDLE:
            continue
        code = int(a) | int(b) << 16 | int(c) << 32
        # Multiplication mixes the bits of neighbours (Knuth, The Art of Computer Programming 3, section 6.4).
        place = (code * -7046029254386353131 >> 20) & last
        while table[place] != -1 and table[place] != code:
            place = (place + 1) & last
        if table[place] == code:
            continue  # where one point of a cell is an obstacle, all are
        a, b, c = _moved(to_mask, x, y, z)
        outside[i] = not inside(mask, a, b, c)
        if outside[i]:
            table[place] = code
            codes[count] = code
            count += 1
    return count


@compiled
def misses(codes: np.ndarray, transforms: tuple[Transform, Transform], mask: MaskArrays, side: float, bins: np.ndarray,
           missed: np.ndarray, masked: np.ndarray) -> None:
    """Fill ``missed`` (n,): a ray passed through the cell, and ``masked`` (n,): its middle is in the mask.

    transforms: (map to the mask's frame, map to the sensor's).
    """
    to_mask, to_sensor = transforms
    half_diagonal = 0.5 * math.sqrt(3.0) * side
    for i in range(codes.shape[0]):
        x = ((codes[i] & 0xFFFF) - MIDDLE + 0.5) * side
        y = ((codes[i] >> 16 & 0xFFFF) - MIDDLE + 0.5) * side
        z = ((codes[i] >> 32 & 0xFFFF) - MIDDLE + 0.5) * side
        a, b, c = _moved(to_mask, x, y, z)
        masked[i] = inside(mask, a, b, c)
        a, b, c = _moved(to_sensor, x, y, z)
        distance = math.sqrt(a * a + b * b + c * c)
        missed[i] = False
        if distance > _NEAREST:
            missed[i] = _passed(bins, _bin(a, b, c, distance), _INNER * side / distance / BIN_RAD,
                                distance + half_diagonal)


@compiled
def inside(mask: MaskArrays, x: float, y: float, z: float) -> bool:
    """Whether a point in the mask's frame is in one of its solids."""
    balls, starts, solids = mask
    for group in range(balls.shape[0]):
        a, b, c = x - balls[group, 0], y - balls[group, 1], z - balls[group, 2]
        if a * a + b * b + c * c > balls[group, 3] * balls[group, 3]:
            continue
        for i in range(starts[group], starts[group + 1]):
            solid = solids[i]
            a, b, c = x - solid[0], y - solid[1], z - solid[2]
            if solid[15] == BALL:
                if a * a + b * b + c * c <= solid[12] * solid[12]:
                    return True
                continue
            w = solid[9] * a + solid[10] * b + solid[11] * c
            if abs(w) > solid[14]:
                continue
            u = solid[3] * a + solid[4] * b + solid[5] * c
            v = solid[6] * a + solid[7] * b + solid[8] * c
            if solid[15] == CYLINDER:
                if u * u + v * v <= solid[12] * solid[12]:
                    return True
            elif abs(u) <= solid[12] and abs(v) <= solid[13]:
                return True
    return False


@compiled
def _passed(bins: np.ndarray, middle: tuple[int, int], reach: float, distance: float) -> bool:
    """Whether a ray less than ``reach`` bins from the middle one is longer than ``distance`` [m]."""
    high, around = middle
    wide = int(reach / max(0.05, math.sin((high + 0.5) * BIN_RAD)))
    tall = int(reach)
    for i in range(max(0, high - tall), min(HIGH, high + tall + 1)):
        for j in range(around - wide, around + wide + 1):
            reached = bins[i, j % AROUND]
            if reached < math.inf and reached > distance:
                return True
    return False


@compiled
def _moved(transform: Transform, x: float, y: float, z: float) -> tuple[float, float, float]:
    rotation, translation = transform
    return (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0],
            rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1],
            rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2])


@compiled
def _bin(x: float, y: float, z: float, distance: float) -> tuple[int, int]:
    high = int(math.acos(max(-1.0, min(1.0, y / distance))) / BIN_RAD)
    return high, int((math.atan2(x, z) + math.pi) / BIN_RAD)


def warm_up() -> None:
    """Compile everything, or load it from the cache."""
    mask = np.zeros((1, 4)), np.zeros(2, dtype=np.int64), np.zeros((1, 16))
    still = np.eye(3), np.zeros(3)
    bins, codes, outside = np.full((HIGH, AROUND), np.inf, np.float32), np.zeros(1, np.int64), np.zeros(1, np.bool_)
    sees(np.ones((1, 3), np.float32), (still, still), mask, (0.1, 5.0), bins, codes, outside)
    misses(codes, (still, still), mask, 0.1, bins, outside, outside.copy())
    fills(np.ones((1, 3), np.float32), (still, still), mask, (0.1, 5.0), np.full(2, -1, np.int64), codes, outside)
