# SPDX-License-Identifier: BSD-3-Clause
"""Straight lines between points, with arcs of circles in place of the corners.

T. Kunz, M. Stilman: Time-Optimal Trajectory Generation for Path Following with Bounded Acceleration and Velocity
(RSS 2012), section IV: an arc touches both lines and stays within a tolerance of the corner.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    _Arc = tuple[float, np.ndarray, np.ndarray, np.ndarray, float]

# Turns below this [rad] need no arc; turns within it of a full reversal cannot have one: the motion stops there.
_STRAIGHT = 1e-4
_REVERSAL = 0.02
# Pieces shorter than this [rad or m] are left out.
_SHORTEST = 1e-9


class RoundedPath:
    """A curve q(s), s [rad or m] from 0 to ``length``, made of pieces; q(0) and q(length) are the path's ends.

    starts (p + 1,): s at the ends of the pieces; stops: set of indices into ``starts`` where the direction jumps.
    """

    def __init__(self, path: np.ndarray, tolerance: float) -> None:
        """``path`` (m, k), m at least 2, no two points in a row the same; ``tolerance`` above 0."""
        steps = np.diff(path, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        directions = steps / lengths[:, None]
        pieces, self.stops = [], set()
        entered = 0.0  # how much of the current line the arc before it has taken
        for i, (length, direction) in enumerate(zip(lengths, directions, strict=True)):
            cut, arc = 0.0, None
            if i + 1 < len(lengths):
                cut, arc = _corner(path[i + 1], direction, directions[i + 1], length, lengths[i + 1], tolerance)
            straight = length - entered - cut
            if straight > _SHORTEST:
                pieces.append((straight, path[i] + entered * direction, direction, np.zeros_like(direction), math.inf))
            if arc is not None:
                pieces.append(arc)
            elif i + 1 < len(lengths) and cut == 0.0 and _turn(direction, directions[i + 1]) > _STRAIGHT:
                self.stops.add(len(pieces))
            entered = cut
        self._lengths = np.array([piece[0] for piece in pieces])
        self._origins, self._first, self._second = (np.array([piece[i] for piece in pieces]) for i in (1, 2, 3))
        self._radii = np.array([piece[4] for piece in pieces])
        self.starts = np.concatenate([[0.0], np.cumsum(self._lengths)])
        self.length = float(self.starts[-1])
        self._ends = np.array(path[0]), np.array(path[-1])

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q and dq/ds (n, k) at s (n,)."""
        piece = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self._lengths) - 1)
        q, first, _ = self._on_piece(piece, s - self.starts[piece])
        q[s <= 0.0], q[s >= self.length] = self._ends
        return q, first

    def grid(self, spacing: float, turn: float) -> tuple[np.ndarray, np.ndarray, set[int]]:
        """Cut the pieces: s (n + 1,), derivatives (4, n, k), and the set of indices into s where to stop.

        derivatives: dq/ds, d2q/ds2 at the left end of each interval, then at the right. Intervals are at most
        ``spacing`` long, arcs' at most ``turn`` [rad]; each piece has two or more.
        """
        with np.errstate(divide="ignore"):
            counts = np.maximum(2, np.ceil(np.maximum(self._lengths / spacing, self._lengths / self._radii / turn)))
        counts = counts.astype(int)
        piece = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
        width = (self._lengths / counts)[piece]
        s = np.concatenate([self.starts[piece] + number * width, [self.length]])
        _, left1, left2 = self._on_piece(piece, number * width)
        _, right1, right2 = self._on_piece(piece, (number + 1) * width)
        first_of_piece = np.concatenate([[0], np.cumsum(counts)])
        return s, np.array([left1, left2, right1, right2]), {int(first_of_piece[stop]) for stop in self.stops}

    def _on_piece(self, piece: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        radius, s = self._radii[piece][:, None], s[:, None]
        origin, first, second = self._origins[piece], self._first[piece], self._second[piece]
        straight = np.isinf(radius)
        bend = np.where(straight, 1.0, radius)
        cosine, sine = np.cos(s / bend), np.sin(s / bend)
        # On a line ``first`` is the direction, on an arc the unit vector from the centre to its start.
        q = np.where(straight, origin + s * first, origin + bend * (first * cosine + second * sine))
        derivative = np.where(straight, first, second * cosine - first * sine)
        curvature = np.where(straight, 0.0, -(first * cosine + second * sine) / bend)
        return q, derivative, curvature


def _turn(before: np.ndarray, after: np.ndarray) -> float:
    """The angle [rad] between two unit vectors; exact for small ones."""
    return 2.0 * math.atan2(np.linalg.norm(after - before), np.linalg.norm(after + before))


def _corner(corner: np.ndarray, before: np.ndarray, after: np.ndarray, length_before: float, length_after: float,
            tolerance: float) -> tuple[float, _Arc | None]:
    """How much of each line the arc takes, and the arc (length, centre, first, second, radius); 0, None if none."""
    turn = _turn(before, after)
    if turn < _STRAIGHT or turn > math.pi - _REVERSAL:
        return 0.0, None
    half = 0.5 * turn
    cut = min(0.5 * length_before, 0.5 * length_after, tolerance * math.sin(half) / (1.0 - math.cos(half)))
    radius = cut / math.tan(half)
    if radius * turn <= _SHORTEST:
        return 0.0, None
    start = corner - cut * before
    inward = after - before
    centre = corner + inward / np.linalg.norm(inward) * radius / math.cos(half)
    first = (start - centre) / radius
    return cut, (radius * turn, centre, first, before, radius)
