# SPDX-License-Identifier: BSD-3-Clause
"""Cut a mesh along planes: the convex hulls of its parts approximate it better than one hull.

Bullet collides convex shapes quickly and robustly, but not moving or thin-walled triangle meshes. The caller knows
where a shape is hollow and gives the planes; nothing is searched.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

AXES = "xyz"


def cut(triangles: Iterable, planes: Iterable[Sequence]) -> list[list[tuple]]:
    """Return the parts of a mesh as lists of points (x, y, z), parts without points left out.

    triangles: sequence of (3, 3) corners; planes: sequence of (axis "x", "y" or "z", offset), each cutting all of the
    mesh, or of (axis, offset, low, high), which cut only those parts that lie between low and high along z. A triangle
    that crosses a plane is cut there, so that the hulls of neighbours meet in the plane.
    """
    parts = [[[tuple(map(float, corner)) for corner in triangle] for triangle in triangles]]
    for axis, offset, *limits in planes:
        halves = []
        for polygons in parts:
            if limits and not _lies_between(polygons, *limits):
                halves.append(polygons)
                continue
            for sign in (1.0, -1.0):
                kept = [_clip(polygon, AXES.index(axis), offset, sign) for polygon in polygons]
                halves.append([polygon for polygon in kept if polygon])
        parts = halves
    return [sorted({point for polygon in polygons for point in polygon}) for polygons in parts if polygons]


def _lies_between(polygons: Iterable[list[tuple]], low: float, high: float) -> bool:
    heights = [point[2] for polygon in polygons for point in polygon]
    return all(low <= height <= high for height in heights)


def _clip(polygon: list[tuple], axis: int, offset: float, sign: float) -> list[tuple]:
    """Return the part of a convex polygon on one side of a plane; empty if that is only an edge.

    A polygon in the plane itself belongs to neither side: it would close the hollow side's hull with a lid.
    """
    heights = [sign * (point[axis] - offset) for point in polygon]
    if max(heights) <= 0.0:
        return []
    if min(heights) >= 0.0:
        return polygon
    kept = []
    for i, (point, height) in enumerate(zip(polygon, heights, strict=True)):
        before, height_before = polygon[i - 1], heights[i - 1]
        if (height < 0.0) != (height_before < 0.0):
            share = height_before / (height_before - height)
            crossing = [a + share * (b - a) for a, b in zip(before, point, strict=True)]
            crossing[axis] = offset
            kept.append(tuple(crossing))
        if height >= 0.0:
            kept.append(point)
    return kept
