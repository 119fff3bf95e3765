# SPDX-License-Identifier: BSD-3-Clause
"""Shapes drawn over the picture: boxes, frames, names, contacts, the spring. In pixels, for any painter. ROS-free."""
from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from sensor_renderer.mirror import DrawnPart
    from sensor_renderer.pinhole import Pinhole

#: Axes x, y, z as everywhere in ROS; other colours [red, green, blue].
AXES = ((214, 39, 40), (34, 150, 60), (31, 90, 210))
WHITE, CONTACT, SPRING = (255, 255, 255), (255, 200, 0), (255, 90, 0)
_AXIS_M = 0.1
# A contact's line: its length per force, and within which lengths.
_LENGTH_PER_N, _SHORTEST_M, _LONGEST_M = 0.002, 0.03, 0.3
_EDGES = [(a, b) for a, b in itertools.combinations(range(8), 2) if bin(a ^ b).count("1") == 1]


class ScreenLine(NamedTuple):
    """From ``x0``, ``y0`` to ``x1``, ``y1`` [pixels]."""

    x0: float
    y0: float
    x1: float
    y1: float
    colour: tuple[int, int, int]
    width: float = 1.5


class Dot(NamedTuple):
    """A filled circle [pixels]."""

    x: float
    y: float
    colour: tuple[int, int, int]
    radius: float = 3.0


class Text(NamedTuple):
    """Words whose lower left corner is at ``x``, ``y`` [pixels]."""

    x: float
    y: float
    words: str


Shape = ScreenLine | Dot | Text


class ShownContact(NamedTuple):
    """``position`` and unit ``normal`` (3,) in the world; ``force`` along it [N]."""

    position: tuple[float, float, float]
    normal: tuple[float, float, float]
    force: float


class Overlay:
    """Collects ``shapes`` for one picture. All points are in the world [m]."""

    def __init__(self, pinhole: Pinhole, pose: np.ndarray) -> None:
        """``pinhole``, ``pose``: the camera, as for the renderer."""
        self.shapes: list[Shape] = []
        self._pinhole = pinhole
        self._view = np.linalg.inv(pose)

    def line(self, start: Sequence[float] | np.ndarray, end: Sequence[float] | np.ndarray, colour: tuple[int, int, int],
             width: float = 1.5) -> None:
        """A straight line; the part behind the eye is left out."""
        a, b = (self._view[:3, :3] @ np.asarray(point) + self._view[:3, 3] for point in (start, end))
        near = self._pinhole.near
        if a[2] < near and b[2] < near:
            return
        if a[2] < near:
            a = a + (b - a) * (near - a[2]) / (b[2] - a[2])
        elif b[2] < near:
            b = b + (a - b) * (near - b[2]) / (a[2] - b[2])
        (x0, y0), (x1, y1) = self._pinhole.project([a, b]).tolist()
        self.shapes.append(ScreenLine(x0, y0, x1, y1, colour, width))

    def dot(self, point: Sequence[float] | np.ndarray, colour: tuple[int, int, int], radius: float = 3.0) -> None:
        """A dot; nothing behind the eye."""
        place = self._place(point)
        if place is not None:
            self.shapes.append(Dot(place[0], place[1], colour, radius))

    def text(self, point: Sequence[float] | np.ndarray, words: str) -> None:
        """Words beside a point; nothing behind the eye."""
        place = self._place(point)
        if place is not None:
            self.shapes.append(Text(place[0] + 6.0, place[1] - 6.0, words))

    def frame(self, matrix: np.ndarray, name: str = "") -> None:
        """The axes of a frame (4, 4), with its name."""
        for axis, colour in zip(matrix[:3, :3].T, AXES, strict=True):
            self.line(matrix[:3, 3], matrix[:3, 3] + _AXIS_M * axis, colour, 2.0)
        if name:
            self.text(matrix[:3, 3], name)

    def box(self, low: np.ndarray, high: np.ndarray, matrix: np.ndarray, colour: tuple[int, int, int] = WHITE) -> None:
        """The edges of a box from ``low`` to ``high`` (3,) in the frame ``matrix`` (4, 4)."""
        corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
        corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
        for a, b in _EDGES:
            self.line(corners[a], corners[b], colour, 1.0)

    def contact(self, contact: ShownContact) -> None:
        """A point of contact, with a line along the normal that is longer for a larger force."""
        self.dot(contact.position, CONTACT)
        length = min(max(_LENGTH_PER_N * abs(contact.force), _SHORTEST_M), _LONGEST_M)
        self.line(contact.position, np.add(contact.position, np.multiply(length, contact.normal)), CONTACT, 2.0)

    def spring(self, grip: Sequence[float] | np.ndarray, target: Sequence[float] | np.ndarray) -> None:
        """The spring of a pull."""
        self.line(grip, target, SPRING, 2.0)
        self.dot(grip, SPRING, 4.0)
        self.dot(target, SPRING, 4.0)

    def _place(self, point):
        local = self._view[:3, :3] @ np.asarray(point, dtype=float) + self._view[:3, 3]
        if local[2] < self._pinhole.near:
            return None
        return self._pinhole.project([local])[0].tolist()


def bounds_of(parts: Iterable[DrawnPart]) -> tuple[np.ndarray, np.ndarray] | None:
    """(low, high) of the triangles of a link, in its frame; None without any but the floor's."""
    points = [part.triangles[:, :3] for part in parts if not part.is_floor and len(part.triangles)]
    if not points:
        return None
    return np.min([rows.min(axis=0) for rows in points], axis=0), np.max([rows.max(axis=0) for rows in points], axis=0)
