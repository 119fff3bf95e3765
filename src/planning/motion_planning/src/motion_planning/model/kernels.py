# SPDX-License-Identifier: BSD-3-Clause
"""Compiled forward kinematics of a whole robot."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from disk_cache.compiled import compiler

if TYPE_CHECKING:
    import numpy as np

    Kinematics = tuple[np.ndarray, ...]

compiled = compiler("motion_planning_model", [__file__], nogil=True, error_model="numpy")


@compiled
def fill_frames(kinematics: Kinematics, q: np.ndarray, base: np.ndarray, frames: np.ndarray) -> None:
    """Fill ``frames`` (l, 4, 4) with the pose of every link in the frame of ``base`` (4, 4).

    kinematics, one entry per link, parents first: parents (l,) index of the parent link, -1 for the root;
    origins (l, 4, 4) and axes (l, 3) of its joint; kinds (l,): 0 fixed, 1 revolute, 2 prismatic; variables (l,): index
    into ``q``, -1 for none; factors (l, 2): multiplier and offset of the value.
    """
    for link in range(frames.shape[0]):
        fill_frame(kinematics, link, q, base, frames)


@compiled
def fill_frame(kinematics: Kinematics, link: int, q: np.ndarray, base: np.ndarray, frames: np.ndarray) -> None:
    """Fill one of ``frames``, after that of its parent, see ``fill_frames``."""
    parents, origins, axes, kinds, variables, factors = kinematics
    parent = parents[link]
    out, origin = frames[link], origins[link]
    before = base if parent < 0 else frames[parent]
    for a in range(3):
        for b in range(4):
            value = before[a, 0] * origin[0, b] + before[a, 1] * origin[1, b] + before[a, 2] * origin[2, b]
            out[a, b] = value + before[a, 3] if b == 3 else value
    out[3, 0], out[3, 1], out[3, 2], out[3, 3] = 0.0, 0.0, 0.0, 1.0
    if kinds[link] == 0:
        return
    moved = factors[link, 1]
    if variables[link] >= 0:
        moved += factors[link, 0] * q[variables[link]]
    x, y, z = axes[link, 0], axes[link, 1], axes[link, 2]
    if kinds[link] == 2:
        for a in range(3):
            out[a, 3] += moved * (out[a, 0] * x + out[a, 1] * y + out[a, 2] * z)
        return
    s, c = math.sin(moved), math.cos(moved)
    t = 1.0 - c
    for a in range(3):
        u, v, w = out[a, 0], out[a, 1], out[a, 2]
        # Rodrigues' formula, each row of the frame times the joint's rotation.
        dot = t * (u * x + v * y + w * z)
        out[a, 0] = u * c + dot * x + s * (v * z - w * y)
        out[a, 1] = v * c + dot * y + s * (w * x - u * z)
        out[a, 2] = w * c + dot * z + s * (u * y - v * x)
