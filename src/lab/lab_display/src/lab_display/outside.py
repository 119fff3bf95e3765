# SPDX-License-Identifier: BSD-3-Clause
"""The world from outside: a camera outside of the robot, and frames drawn into its picture. ROS-free."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from sensor_renderer.best import best_renderer
from sensor_renderer.following import WorldFollower
from sensor_renderer.pinhole import Pinhole
from sensor_renderer.viewpoint import extent, looking_at, overview

FIELD_OF_VIEW_RAD = 0.75
# Axes x, y, z as everywhere in ROS [red, green, blue].
_AXIS_COLOURS = ((214, 39, 40), (34, 150, 60), (31, 90, 210))


def draw_frame(pixels: np.ndarray, pinhole: Pinhole, view: np.ndarray, frame: np.ndarray, length: float,
               name: str = "") -> None:
    """Draw the axes of `frame` (4, 4 in the world), `length` [m] long, into `pixels`; `view`: world to optical frame.

    A frame behind the camera is left out.
    """
    points = np.vstack([frame[:3, 3], frame[:3, 3] + length * frame[:3, :3].T]) @ view[:3, :3].T + view[:3, 3]
    if (points[:, 2] < pinhole.near).any():
        return
    places = [tuple(int(round(16.0 * value)) for value in place) for place in pinhole.project(points)]
    for axis, colour in enumerate(_AXIS_COLOURS):
        cv2.line(pixels, places[0], places[axis + 1], colour, 2, cv2.LINE_AA, shift=4)
    if name:
        x, y = places[0][0] // 16 + 6, places[0][1] // 16 - 6
        cv2.putText(pixels, name, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (255, 255, 255), 3, cv2.LINE_AA)
        cv2.putText(pixels, name, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (20, 20, 20), 1, cv2.LINE_AA)


class Outside(WorldFollower):
    """Draws the world of one snapshot folder. Use it in the thread that made it."""

    def __init__(self, folder: str, warn: Callable[[str], None]) -> None:
        """Raises world_picture.snapshot.SnapshotError if there is no snapshot."""
        super().__init__(folder, warn)
        self._renderer: Any = None

    def link_pose(self, link: str) -> np.ndarray | None:
        """Pose (4, 4) in the world of a link that is its own body; None if there is none."""
        for body in self.mirror.bodies.values():
            try:
                return body.link_matrix(link)
            except KeyError:
                continue
        return None

    def look(self, width: int = 640, height: int = 480, eye: ArrayLike | None = None,
             target: ArrayLike | None = None, frames: dict[str, np.ndarray] | None = None,
             length: float = 0.12) -> np.ndarray:
        """The picture, uint8 (height, width, 3), of the world as of the last :meth:`follow`.

        `eye`, `target` [m, in the world, where the floor is at 0]: position of the camera and the point it looks at; by
        default the whole world is in view. `frames`: {name: (4, 4) pose in the world} to draw, with axes of `length`
        [m].
        """
        if target is None or eye is None:
            outside, target = overview(*extent(self.mirror), width / height, FIELD_OF_VIEW_RAD, target)
            eye = outside if eye is None else eye
        pose = looking_at(np.asarray(eye, dtype=float), np.asarray(target, dtype=float))
        pinhole = Pinhole.from_field_of_view(width, height, FIELD_OF_VIEW_RAD, 0.05, 100.0)
        if self._renderer is None:
            self._renderer, _ = best_renderer(still=True)
        pixels = self._renderer.render(self.mirror, pinhole, pose)[0].copy()
        for name, frame in (frames or {}).items():
            draw_frame(pixels, pinhole, np.linalg.inv(pose), frame, length, name)
        return pixels

