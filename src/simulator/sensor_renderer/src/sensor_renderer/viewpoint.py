# SPDX-License-Identifier: BSD-3-Clause
"""Where to look at the world from: cameras outside of it. ROS-free."""
from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from sensor_renderer.mirror import Mirror

#: Where the eye is for an overview, relative to the centre of the scene: in front of a robot that looks along x, a
#: little to its left and above.
DIRECTION = np.array([0.78, 0.48, 0.34])
# How much farther away than where everything just fits.
_MARGIN = 1.04


def looking_at(eye: Sequence[float] | np.ndarray, target: Sequence[float] | np.ndarray) -> np.ndarray:
    """Pose (4, 4) in the world of an optical frame (z ahead, x right, y down) at ``eye`` that looks at ``target`` [m].

    Raises ValueError if the camera would look straight up or down.
    """
    ahead = np.subtract(target, eye).astype(float)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    if np.linalg.norm(right) < 1e-6 * max(np.linalg.norm(ahead), 1e-6):
        raise ValueError("the camera at %s cannot look at %s: that is straight up, straight down, or itself"
                         % (tuple(eye), tuple(target)))
    ahead /= np.linalg.norm(ahead)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    pose[:3, 3] = eye
    return pose


def extent(mirror: Mirror) -> tuple[np.ndarray, np.ndarray]:
    """(low, high): the box [m] around all bodies except floors. The unit box if there are none."""
    corners = []
    for body in mirror.bodies.values():
        for parts, matrix in zip(body.parts, body.matrices, strict=True):
            for part in parts:
                if part.is_floor or not len(part.triangles):
                    continue
                points = part.triangles[:, :3] @ matrix[:3, :3].T + matrix[:3, 3]
                corners += [points.min(axis=0), points.max(axis=0)]
    if not corners:
        return np.zeros(3), np.ones(3)
    return np.min(corners, axis=0), np.max(corners, axis=0)


def overview(low: np.ndarray, high: np.ndarray, aspect: float, field_of_view_rad: float,
             target: npt.ArrayLike | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(eye (3,), target (3,)): where a camera looks from and to, so that the box from ``low`` to ``high`` (3,) [m] is
    just in view. ``aspect``: width of the picture by its height; ``field_of_view_rad``: across its width; ``target``:
    by default the middle of the box."""
    target = (low + high) / 2.0 if target is None else np.asarray(target, dtype=float)
    away = DIRECTION / np.linalg.norm(DIRECTION)
    corners = np.array(list(itertools.product(*zip(low, high, strict=True)))) - target
    right, down, ahead = (corners @ looking_at(away, np.zeros(3))[:3, :3]).T
    half = math.tan(field_of_view_rad / 2.0)
    distance = np.max([np.abs(right) / half, np.abs(down) * aspect / half], axis=0) - ahead
    return target + away * _MARGIN * float(distance.max()), target
