# SPDX-License-Identifier: BSD-3-Clause
"""Cubes of an octree as the binary stream of octomap that FCL reads (octomap's ``writeBinaryData``).

Each inner node is two bytes, two bits for each of its children (x the lowest bit of a child's number, then y, z): 0
unknown, 1 free, 2 occupied, 3 an inner node itself, which follows in the order of a depth-first walk.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.shapes import OCTREE_DEPTH

if TYPE_CHECKING:
    from motion_planning.shapes import Octree

_OCCUPIED, _INNER = 2, 3


def occupied_tree(octree: Octree) -> np.ndarray:
    """Return the stream (bytes as int8) of a ``shapes.Octree`` with at least one cube."""
    boxes = octree.boxes
    levels = np.rint(np.log2(boxes[:, 3] / octree.resolution)).astype(np.int64)
    codes = codes_of(octree)
    for level in np.unique(levels):
        # A cube within a larger one adds nothing, and would take the larger one's place in the stream.
        covered = (levels < level) & np.isin(codes >> (3 * level), codes[levels == level] >> (3 * level))
        codes, levels = codes[~covered], levels[~covered]
    nodes, inner = [], np.empty(0, np.int64)
    for level in range(OCTREE_DEPTH):
        leaves = np.unique(codes[levels == level] >> (3 * level))
        children = np.concatenate([leaves, inner])
        values = np.concatenate([np.full(len(leaves), _OCCUPIED), np.full(len(inner), _INNER)])
        inner, where = np.unique(children >> 3, return_inverse=True)
        masks = np.zeros(len(inner), dtype=np.int64)
        np.bitwise_or.at(masks, where, values << (2 * (children & 7)))
        nodes.append((inner << (3 * (level + 1)), np.full(len(inner), OCTREE_DEPTH - level), masks))
    first, depth, masks = (np.concatenate(column) for column in zip(*nodes, strict=True))
    return masks[np.lexsort((depth, first))].astype("<u2").view(np.int8)


def codes_of(octree: Octree) -> np.ndarray:
    """Return (n,) where the middles of an octree's cubes are along Morton's curve, in cells of its resolution."""
    keys = np.floor(octree.boxes[:, :3] / octree.resolution).astype(np.int64) + 2 ** (OCTREE_DEPTH - 1)
    return _spread(keys[:, 0]) | _spread(keys[:, 1]) << 1 | _spread(keys[:, 2]) << 2


def _spread(values: np.ndarray) -> np.ndarray:
    """Numbers of 16 bits with two zero bits between each two."""
    spread = np.zeros(len(values), dtype=np.int64)
    for bit in range(OCTREE_DEPTH):
        spread |= ((values >> bit) & 1) << (3 * bit)
    return spread
