# SPDX-License-Identifier: BSD-3-Clause
"""Balls that points of an arm's tip never leave: a pose outside one of them needs no search."""
from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from arm_kinematics.chain import Chain

# Axes nearer to each other than this [m] meet.
_MEETING_M = 1e-9
# Rounds of the search for a small ball. Any result of it is a valid bound; more rounds make it no smaller than 1e-6 m.
_ROUNDS = 200


class Ball(NamedTuple):
    """The point ``in_tip`` (3,) [m, tip's frame] is always within ``radius`` [m] of ``centre`` (3,) [base frame]."""

    in_tip: np.ndarray
    centre: np.ndarray
    radius: float

    def beyond(self, poses: np.ndarray) -> np.ndarray:
        """Which of the tip's ``poses`` (m, 4, 4) would have the point outside (m,), with 1e-6 m for rounding."""
        points = poses[:, :3, 3] + poses[:, :3, :3] @ self.in_tip
        return np.linalg.norm(points - self.centre, axis=1) > self.radius + 1e-6


def balls(chain: Chain) -> list[Ball]:
    """Return the Balls of a Chain: of the tip; and of a point on the last joint's axis, if it is revolute.

    The second point is the one nearest to the axis before. Where both axes meet, neither of the two joints moves it,
    and the ball is that of the joints before them.

    A chain's point is at most as far from a point of its first axis as the length of any path between them that
    crosses each axis at a fixed point: a revolute joint keeps the points of its axis. A prismatic joint adds its
    stroke. The paths here are nearly the shortest.
    """
    rotations, offsets, prismatic = chain.arrays
    last = len(chain) - 1
    found = [Ball(np.zeros(3), *_bound(chain, last + 1, offsets[-1]))]
    if prismatic[last]:
        return found
    # In the last joint's own frame its axis is z; heights are along it. Seen from the frame of the joint before.
    height = _height_nearest_to_z(rotations[last], offsets[last]) if last else 0.0
    point = offsets[last] + rotations[last][:, 2] * height
    in_tip = rotations[-1].T @ (np.array([0.0, 0.0, height]) - offsets[-1])
    meets = last > 0 and not prismatic[last - 1] and np.linalg.norm(point[:2]) < _MEETING_M
    if meets:
        point = offsets[last - 1] + rotations[last - 1] @ point
        found.append(Ball(in_tip, *_bound(chain, last - 1, point)))
    else:
        found.append(Ball(in_tip, *_bound(chain, last, point)))
    return found


def beyond(bounds: Iterable[Ball], poses: np.ndarray) -> np.ndarray:
    """Which of ``poses`` (m, 4, 4) are outside one of the Balls."""
    outside = np.zeros(len(poses), dtype=bool)
    for ball in bounds:
        outside |= ball.beyond(poses)
    return outside


def _bound(chain: Chain, count: int, end: np.ndarray) -> tuple[np.ndarray, float]:
    """Return (centre (3,), radius) for the point ``end`` (3,), given in the frame that ``count`` joints move."""
    rotations, offsets, prismatic = chain.arrays
    if count == 0:
        return end, 0.0
    heights = np.zeros(count)  # of the path's points, along their axes
    for _ in range(_ROUNDS):
        for i in range(count):
            if prismatic[i]:
                continue
            after = end if i == count - 1 else offsets[i + 1] + rotations[i + 1][:, 2] * heights[i + 1]
            across = np.hypot(*after[:2])
            if i == 0:
                heights[i] = after[2]
                continue
            before = rotations[i].T @ (np.array([0.0, 0.0, heights[i - 1]]) - offsets[i])
            # The shortest way from one point to another over an axis, unrolled into a plane, is straight.
            other = np.hypot(*before[:2])
            total = across + other
            heights[i] = (before[2] * across + after[2] * other) / total if total > 0.0 else after[2]
    path = [np.array([0.0, 0.0, height]) for height in heights]
    radius = 0.0
    for i in range(count):
        after = end if i == count - 1 else offsets[i + 1] + rotations[i + 1] @ path[i + 1]
        radius += np.linalg.norm(after - path[i])
        if prismatic[i]:
            lower, upper = (limits[i] for limits in chain.limit_arrays)
            radius += max(abs(lower), abs(upper))
    return offsets[0] + rotations[0] @ path[0], float(radius)


def _height_nearest_to_z(rotation: np.ndarray, offset: np.ndarray) -> float:
    """Return where on its own z axis a frame (``rotation``, ``offset``) is nearest to the outer frame's z axis [m]."""
    direction = rotation[:2, 2]
    square = direction @ direction
    return 0.0 if square < 1e-12 else float(-(offset[:2] @ direction) / square)
