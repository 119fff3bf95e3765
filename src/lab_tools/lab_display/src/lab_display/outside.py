# SPDX-License-Identifier: BSD-3-Clause
"""The world from outside: a camera outside of the robot, and frames drawn into its picture. ROS-free."""
import math

import cv2
import numpy as np

from sensor_renderer.errors import RenderingError
from sensor_renderer.following import WorldFollower
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.pinhole import Pinhole

FIELD_OF_VIEW_RAD = 0.75
# Default position of the camera, relative to the centre of the scene.
DIRECTION = np.array([0.78, 0.48, 0.34])
# Axes x, y, z as everywhere in ROS [red, green, blue].
_AXIS_COLOURS = ((214, 39, 40), (34, 150, 60), (31, 90, 210))


def looking_at(eye, target):
    """Pose (4, 4) in the world of an optical frame (z ahead, x right, y down) at `eye` that looks at `target` [m].

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


def extent(mirror):
    """(low, high): the box [m] around all bodies except floors. The unit box if there are none."""
    corners = []
    for body in mirror.bodies.values():
        for parts, matrix in zip(body.parts, body.matrices, strict=True):
            for part in parts:
                if part.is_floor:
                    continue
                points = part.triangles[:, :3] @ matrix[:3, :3].T + matrix[:3, 3]
                corners += [points.min(axis=0), points.max(axis=0)]
    if not corners:
        return np.zeros(3), np.ones(3)
    return np.min(corners, axis=0), np.max(corners, axis=0)


def draw_frame(pixels, pinhole, view, frame, length, name=""):
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

    def __init__(self, folder, warn):
        """Raises world_picture.snapshot.SnapshotError if there is no snapshot."""
        super().__init__(folder, warn)
        self._renderer = None

    def link_pose(self, link):
        """Pose (4, 4) in the world of a link that is its own body; None if there is none."""
        for body in self.mirror.bodies.values():
            try:
                return body.link_matrix(link)
            except KeyError:
                continue
        return None

    def look(self, width=640, height=480, eye=None, target=None, frames=None, length=0.12):
        """The picture, uint8 (height, width, 3), of the world as of the last :meth:`follow`.

        `eye`, `target` [m, in the world, where the floor is at 0]: position of the camera and the point it looks at; by
        default the whole world is in view. `frames`: {name: (4, 4) pose in the world} to draw, with axes of `length`
        [m].
        """
        if target is None or eye is None:
            low, high = extent(self.mirror)
            middle, radius = (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0
            target = middle if target is None else np.asarray(target, dtype=float)
            narrow = FIELD_OF_VIEW_RAD * min(1.0, height / width)
            away = DIRECTION / np.linalg.norm(DIRECTION)
            eye = target + away * 0.92 * radius / math.sin(narrow / 2.0) if eye is None else eye
        pose = looking_at(eye, target)
        pinhole = Pinhole.from_field_of_view(width, height, FIELD_OF_VIEW_RAD, 0.05, 100.0)
        if self._renderer is None:
            self._renderer = _make_renderer()
        pixels = self._renderer.render(self.mirror, pinhole, pose)[0].copy()
        for name, frame in (frames or {}).items():
            draw_frame(pixels, pinhole, np.linalg.inv(pose), frame, length, name)
        return pixels


def _make_renderer():
    try:
        return GlRenderer()
    except RenderingError:
        from sensor_renderer.tiny_renderer import TinyRenderer

        return TinyRenderer()
