# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a task for people, from outside."""
from __future__ import annotations

import numpy as np

from baxter_lab import Lab
from baxter_lab.cameras import CameraPicture

#: Where it is looked from, and what at [m].
_EYE, _TARGET = (2.2, 1.3, 0.7), (0.55, 0.0, 0.0)
#: Of the ball about a goal: red, green, blue, and how much of it is seen of what is behind.
_COLOUR, _CLEAR = (40.0, 200.0, 60.0), 0.35


def outside_picture(lab: Lab, width: int, height: int, goal: np.ndarray | None, within: float) -> np.ndarray:
    """(height, width, 3) uint8. goal: a place (3,) that a task leads to [m], if it has one: a ball that one can see
    through, of the radius ``within`` [m] in which the goal is reached."""
    picture = lab.cameras.look(_EYE, _TARGET, width, height, depth=goal is not None)
    return picture.pixels if goal is None else with_ball(picture, goal, within)


def with_ball(picture: CameraPicture, place: np.ndarray, radius: float) -> np.ndarray:
    """The pixels (height, width, 3) uint8 of a picture with depth, and in it a ball at ``place`` (3,) in `base` [m],
    where nothing stands before it."""
    assert picture.depth is not None
    height, width = picture.depth.shape
    x = (np.arange(width) - picture.matrix[0, 2]) / picture.matrix[0, 0]
    y = (np.arange(height) - picture.matrix[1, 2]) / picture.matrix[1, 1]
    rays = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=2)  # a depth along z is their length
    centre = picture.camera[:3, :3].T @ (place - picture.camera[:3, 3])
    # The first point of a ray in the ball: |depth * ray - centre| = radius.
    squared, along = (rays * rays).sum(axis=2), rays @ centre
    root = along * along - squared * (centre @ centre - radius * radius)
    depth = (along - np.sqrt(np.maximum(root, 0.0))) / squared
    seen = (root > 0.0) & (depth > 0.0) & ~(picture.depth < depth)
    pixels = picture.pixels.copy()
    pixels[seen] = (_CLEAR * pixels[seen] + (1.0 - _CLEAR) * np.array(_COLOUR)).astype(np.uint8)
    return pixels
