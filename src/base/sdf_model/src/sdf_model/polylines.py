# SPDX-License-Identifier: BSD-3-Clause
"""<polyline>: closed lines in the xy plane that are drawn up to a height, as a mesh in the user's cache folder."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from disk_cache.files import cache_home, draft_of, spare_folder

# The work grows with the square of the number.
MAX_POINTS = 2000
# Points of a line that are nearer to each other are one [m].
_SAME_M = 1e-9
# The part of the area by which triangles may miss it.
_LOST = 1e-6
_CROSSED = "lines that cross each other or themselves"


def polyline_file(lines: Sequence[Sequence[tuple[float, float]]], height: float) -> str:
    """Return the path of a Wavefront file of the body between z = 0 and ``height`` [m] whose base ``lines`` bound, each
    closed [m]. A line inside of another is a hole.

    Raises ValueError for lines that bound nothing, cross themselves or have more than MAX_POINTS points, and OSError.
    """
    outlines = [_cleaned(line) for line in lines]
    if sum(map(len, outlines)) > MAX_POINTS:
        raise ValueError("more than %d points" % MAX_POINTS)
    points, faces = extruded(outlines, height)
    text = "\n".join(["v %.9g %.9g %.9g" % tuple(point) for point in points]
                     + ["f %d %d %d" % tuple(face) for face in faces + 1]) + "\n"
    name = hashlib.sha256(text.encode()).hexdigest()[:32] + ".obj"
    folder = cache_home() / "sdf_model" / "polylines"
    try:
        return _kept(folder, name, text)
    except OSError:
        return _kept(spare_folder("sdf_model_polylines"), name, text)


def _kept(folder: Path, name: str, text: str) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    if not path.exists():
        with draft_of(path) as draft:
            draft.write_text(text, encoding="ascii")
    return str(path)


def extruded(outlines: Sequence[np.ndarray], height: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) and triangles (m, 3), counter-clockwise from outside, of the body over ``outlines``, each an array
    (k, 2)."""
    depth = [sum(_is_inside(line[0], other) for other in outlines if other is not line) for line in outlines]
    outlines = [_turned(line, counter_clockwise=level % 2 == 0) for line, level in zip(outlines, depth, strict=True)]
    flat = np.concatenate(outlines)
    first = np.cumsum([0, *map(len, outlines)])
    rings = [list(range(begin, begin + len(line))) for begin, line in zip(first, outlines, strict=False)]
    faces = []
    for number, level in enumerate(depth):
        if level % 2 == 0:
            holes = [rings[other] for other, inner in enumerate(depth)
                     if inner == level + 1 and _is_inside(outlines[other][0], outlines[number])]
            faces += _ears(flat, _bridged(flat, rings[number], holes))
    area, parts = sum(map(_area, outlines)), [0.5 * _turn(flat, face) for face in faces]
    if min(parts) < -_LOST * area or abs(sum(parts) - area) > _LOST * area:
        raise ValueError(_CROSSED)
    count, sides = len(flat), []
    for ring in rings:
        for here, there in zip(ring, ring[1:] + ring[:1], strict=True):
            sides += [(here, there, there + count), (here, there + count, here + count)]
    top = np.array(faces) + count
    points = np.concatenate([np.column_stack([flat, np.full(count, z)]) for z in (0.0, height)])
    return points, np.concatenate([np.array(faces)[:, ::-1], top, np.array(sides)])


def _cleaned(line: Sequence[tuple[float, float]]) -> np.ndarray:
    """A line (k, 2) without points that repeat the one before."""
    points = np.asarray(line, dtype=float).reshape(-1, 2)
    kept = points[np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > _SAME_M]
    if len(kept) < 3 or abs(_area(kept)) <= _SAME_M ** 2:
        raise ValueError("a line of %d points that bounds no area; expected three points or more" % len(points))
    return kept


def _area(line: np.ndarray) -> float:
    """Area of a closed line, positive if it is counter-clockwise (Gauss's formula)."""
    x, y = line.T
    return 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)


def _turned(line: np.ndarray, counter_clockwise: bool) -> np.ndarray:
    return line if (_area(line) > 0.0) == counter_clockwise else line[::-1]


def _is_inside(point: np.ndarray, line: np.ndarray) -> bool:
    """Whether a point is inside of a closed line: a ray in x crosses it an odd number of times."""
    here, there = line, np.roll(line, -1, axis=0)
    crosses = (here[:, 1] > point[1]) != (there[:, 1] > point[1])
    rise = np.where(crosses, there[:, 1] - here[:, 1], 1.0)
    at = here[:, 0] + (point[1] - here[:, 1]) / rise * (there[:, 0] - here[:, 0])
    return bool(np.count_nonzero(crosses & (at > point[0])) % 2)


def _bridged(points: np.ndarray, ring: list[int], holes: list[list[int]]) -> list[int]:
    """One ring around the area of ``ring`` without ``holes``: each hole hangs on a bridge from its rightmost point."""
    for hole in sorted(holes, key=lambda hole: -points[hole, 0].max()):
        start = int(points[hole, 0].argmax())
        hole = hole[start:] + hole[:start]
        reached = _visible(points, ring, hole[0], holes)
        ring = [*ring[:reached + 1], *hole, hole[0], *ring[reached:]]
    return ring


def _visible(points: np.ndarray, ring: list[int], start: int, holes: list[list[int]]) -> int:
    """The place in ``ring`` of the nearest point that is seen from the point ``start``."""
    edges = [(ring[i], ring[(i + 1) % len(ring)]) for i in range(len(ring))]
    edges += [(hole[i], hole[(i + 1) % len(hole)]) for hole in holes for i in range(len(hole))]
    a, b = points[[edge[0] for edge in edges]], points[[edge[1] for edge in edges]]
    for place in np.argsort(np.linalg.norm(points[ring] - points[start], axis=1), kind="stable"):
        p, q = points[start], points[ring[place]]
        crosses = (_side(a, b, p) * _side(a, b, q) < 0.0) & (_side(p, q, a) * _side(p, q, b) < 0.0)
        part = (a - p) @ (q - p) / ((q - p) @ (q - p))
        touches = (_side(p, q, a) == 0.0) & (part > 0.0) & (part < 1.0)
        if not (crosses | touches).any() and _opens(points, ring, int(place), p):
            return int(place)
    raise ValueError(_CROSSED)


def _opens(points: np.ndarray, ring: list[int], place: int, target: np.ndarray) -> bool:
    """Whether ``target`` is in the angle at a place of a counter-clockwise ring."""
    before, here, after = (points[ring[(place + step) % len(ring)]] for step in (-1, 0, 1))
    left, right = _side(here, after, target) >= 0.0, _side(before, here, target) >= 0.0
    return bool((left and right) if _side(before, here, after) >= 0.0 else (left or right))


def _ears(points: np.ndarray, ring: list[int]) -> list[tuple[int, int, int]]:
    """Triangles of the area in a counter-clockwise ring: ears, corners without another point in them, are cut off."""
    faces: list[tuple[int, int, int]] = []
    ring = list(ring)
    while len(ring) > 3:
        place = next((place for place in range(len(ring)) if _is_ear(points, ring, place)), None)
        if place is None:
            # A point on the line between its neighbours, as at the end of a bridge.
            place = next((place for place in range(len(ring)) if _turn(points, _corner(ring, place)) == 0.0), None)
            if place is None:
                raise ValueError(_CROSSED)
        else:
            faces.append(_corner(ring, place))
        del ring[place]
    return [*faces, (ring[0], ring[1], ring[2])]


def _corner(ring: list[int], place: int) -> tuple[int, int, int]:
    return ring[place - 1], ring[place], ring[(place + 1) % len(ring)]


def _turn(points: np.ndarray, corner: tuple[int, int, int]) -> float:
    return float(_side(*points[list(corner)]))


def _is_ear(points: np.ndarray, ring: list[int], place: int) -> bool:
    corner = _corner(ring, place)
    if _turn(points, corner) <= 0.0:
        return False
    a, b, c = points[list(corner)]
    others = points[[index for index in ring if index not in corner]]
    inside = (_side(a, b, others) >= 0.0) & (_side(b, c, others) >= 0.0) & (_side(c, a, others) >= 0.0)
    same = (np.abs(others[:, None] - points[list(corner)]).max(axis=2) <= _SAME_M).any(axis=1)
    return not (inside & ~same).any()


def _side(a: np.ndarray, b: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Twice the area of the triangle a, b, point: positive where the point is to the left; arrays broadcast."""
    a, b, point = np.asarray(a), np.asarray(b), np.asarray(point)
    along, to = b - a, point - a
    return along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]
