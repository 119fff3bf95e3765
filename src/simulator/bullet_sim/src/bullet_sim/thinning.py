# SPDX-License-Identifier: BSD-3-Clause
"""Meshes with fewer triangles and about the same shape, by merging the vertices that share a cell of a grid."""

from __future__ import annotations

import numpy as np

_COARSEST_GRID, _FINEST_GRID = 2, 512
# A mesh with more triangles is first reduced to this number, so that the search for the grid stays cheap.
_MANY = 100_000
_HALVED_GRIDS = (256, 128, 64)


def thin_out(vertices: np.ndarray, faces: np.ndarray, target: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (vertices, faces) of about the same shape, at most ``target`` triangles, if possible.

    Vertices (n, 3) that share a cell of a cubic grid become their mean; triangles (m, 3) that lose a corner are
    removed, and equal ones are merged. Uses the finest grid that meets the target.
    """
    if len(faces) <= target:
        return vertices, faces
    low, size = _extent(vertices)
    coarse, fine, best = _COARSEST_GRID, _FINEST_GRID, None
    for cells in _HALVED_GRIDS:
        if len(faces) <= _MANY:
            break
        merged = _merged(vertices, faces, _clusters(vertices, low, cells / size))
        if len(merged[1]) <= target:
            coarse, best = cells, merged
            break
        vertices, faces, fine = *merged, cells
    while fine - coarse > 1:
        cells = (coarse + fine) // 2
        merged = _merged(vertices, faces, _clusters(vertices, low, cells / size))
        if len(merged[1]) <= target:
            coarse, best = cells, merged
        else:
            fine = cells
    return best if best is not None else (vertices, faces)


def outermost(vertices: np.ndarray, grid: int = 128) -> np.ndarray:
    """Return of the vertices (n, 3) in each cell of a cubic grid, ``grid`` cells across, the one that is farthest out.

    Farthest from the mean of all vertices: the result has about the same convex hull.
    """
    low, size = _extent(vertices)
    cluster = _clusters(vertices, low, grid / size)
    away = np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)
    farthest = np.zeros(cluster.max() + 1, dtype=int)
    order = np.argsort(away)
    farthest[cluster[order]] = order  # of several the last one stays
    return vertices[farthest]


def _extent(vertices: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the lowest corner (3,) of the box around ``vertices`` (n, 3) and its longest side."""
    return vertices.min(axis=0), max(float(np.ptp(vertices, axis=0).max()), 1e-9)


def _clusters(vertices: np.ndarray, low: np.ndarray, cells_per_m: float) -> np.ndarray:
    """Return for each of ``vertices`` (n, 3) the number of the cell that it lies in; empty cells have none."""
    cell = np.floor((vertices - low) * cells_per_m).astype(np.int64) @ np.array([1, 4096, 4096**2])
    return np.unique(cell, return_inverse=True)[1]


def _merged(vertices: np.ndarray, faces: np.ndarray, cluster: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    count = np.bincount(cluster)
    merged = np.stack([np.bincount(cluster, vertices[:, k]) / count for k in range(3)], axis=1)
    corners = cluster[faces]
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 0] != corners[:, 2])
    corners = corners[whole]
    # Smallest corner first, the sense of rotation kept: thin walls have two triangles that face apart.
    start = corners.argmin(axis=1)[:, None]
    corners = np.take_along_axis(corners, (start + np.arange(3)) % 3, axis=1)
    # One number for each triangle, in two steps since three large numbers need more than 64 bits; np.unique would take
    # four times as long for the rows themselves.
    pairs, pair = np.unique(corners[:, 0] * len(merged) + corners[:, 1], return_inverse=True)
    triangles = np.unique(pair * len(merged) + corners[:, 2])
    pairs = pairs[triangles // len(merged)]
    return merged, np.stack([pairs // len(merged), pairs % len(merged), triangles % len(merged)], axis=1)
