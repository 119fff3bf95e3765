# SPDX-License-Identifier: BSD-3-Clause
"""Arcs of a link, and curves of joints through points. Their parameter is the fraction of the path, 0 to 1."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.cartesian import Line
from motion_planning.errors import PlanningError
from urdf_model.transforms import axis_rotation, rigid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# The distances of start and goal from a given centre may differ by this much [m].
_CENTRE_TOLERANCE_M = 1e-2
# Three points within this of a line [of their distances' product, or m] are on no circle.
_STRAIGHT = 1e-4


class NoCircle(PlanningError):
    """There is no arc through these points; the text gives the reason."""


class Arc:
    """Poses (4, 4) on an arc of a circle; the rotation turns about one axis, in step with it. length [m], angle [rad]:
    of the arc, and of the link's rotation."""

    def __init__(self, begin: np.ndarray, end: np.ndarray, centre: np.ndarray, axis: np.ndarray, sweep: float) -> None:
        """begin, end (4, 4); centre, axis (3,): of the circle; sweep [rad], above 0: about the axis."""
        self._turn, self._centre, self._axis, self._sweep = Line(begin, end), centre, axis, sweep
        self._arm = begin[:3, 3] - centre
        self.length, self.angle = sweep * float(np.linalg.norm(self._arm)), self._turn.angle

    def at(self, fraction: float) -> np.ndarray:
        """Return the pose at ``fraction`` of the path."""
        position = self._centre + axis_rotation(self._axis, fraction * self._sweep) @ self._arm
        return rigid(self._turn.at(fraction)[:3, :3], position)


def arc_about(begin: np.ndarray, end: np.ndarray, centre: np.ndarray) -> Arc:
    """Return the shorter :class:`Arc` between two poses (4, 4) about ``centre`` (3,). Raises NoCircle."""
    a, b = begin[:3, 3] - centre, end[:3, 3] - centre
    radii = np.linalg.norm(a), np.linalg.norm(b)
    if abs(radii[0] - radii[1]) > _CENTRE_TOLERANCE_M:
        raise NoCircle("the start is %.4f m from the centre, the goal %.4f m; they may differ by %g m"
                       % (*radii, _CENTRE_TOLERANCE_M))
    chord = b - a
    across = np.cross(a, b)
    if np.linalg.norm(across) <= _STRAIGHT * max(radii) ** 2 or np.linalg.norm(chord) <= _STRAIGHT * max(radii):
        raise NoCircle("start, centre and goal are on one line, or one point; which arc is meant? Give a point on the "
                       "way ('interim') for half a circle")
    # The centre is moved along the chord, so that the arc ends exactly in the goal.
    unit = chord / np.linalg.norm(chord)
    centre = centre + 0.5 * ((a + b) @ unit) * unit
    a, b = begin[:3, 3] - centre, end[:3, 3] - centre
    across = np.cross(a, b)
    return Arc(begin, end, centre, across / np.linalg.norm(across), math.atan2(np.linalg.norm(across), a @ b))


def arc_through(begin: np.ndarray, end: np.ndarray, interim: np.ndarray) -> Arc:
    """Return the :class:`Arc` between two poses (4, 4) by way of ``interim`` (3,). Raises NoCircle."""
    a, b = begin[:3, 3] - interim, end[:3, 3] - interim
    across = np.cross(a, b)
    area = float(np.linalg.norm(across))
    sizes = np.linalg.norm(a), np.linalg.norm(b), np.linalg.norm(a - b)
    if min(sizes) < _STRAIGHT or area <= _STRAIGHT * max(sizes) ** 2:
        raise NoCircle("start, interim point and goal are on one line, or two of them are the same; an arc needs three "
                       "points of a circle")
    # The circumcentre, seen from the interim point.
    centre = interim + np.cross((a @ a) * b - (b @ b) * a, across) / (2.0 * area**2)
    axis = np.cross(-a, b)  # from the start to the interim point, and on to the goal
    axis /= np.linalg.norm(axis)
    first, last = begin[:3, 3] - centre, end[:3, 3] - centre
    sweep = math.atan2(np.cross(first, last) @ axis, first @ last) % (2.0 * math.pi)
    return Arc(begin, end, centre, axis, sweep)


class Straight:
    """Joints (k,) in a straight line."""

    def __init__(self, begin: np.ndarray, end: np.ndarray) -> None:
        self._begin, self._way = begin, end - begin

    def at(self, fractions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return values (n, k) and two derivatives by the fraction at ``fractions`` (n,)."""
        rest = np.zeros((len(fractions), len(self._way)))
        return self._begin + fractions[:, None] * self._way, rest + self._way, rest


class Spline:
    """A curve of joints through points, with two continuous derivatives."""

    def __init__(self, fractions: ArrayLike, points: ArrayLike) -> None:
        """fractions (m,) from 0 to 1, strictly increasing, m at least 4; points (m, k)."""
        self._knots, self._points = np.asarray(fractions, dtype=float), np.asarray(points, dtype=float)
        first = _slope(self._knots[:4], self._points[:4])
        last = _slope(self._knots[:-5:-1], self._points[:-5:-1])
        self._bends = _bends(self._knots, self._points, first, last)

    def at(self, fractions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return values (n, k) and two derivatives by the fraction at ``fractions`` (n,)."""
        i = np.clip(np.searchsorted(self._knots, fractions, side="right") - 1, 0, len(self._knots) - 2)
        h = np.diff(self._knots)[i][:, None]
        right = (fractions - self._knots[i])[:, None] / h
        left = 1.0 - right
        p0, p1, b0, b1 = self._points[i], self._points[i + 1], self._bends[i], self._bends[i + 1]
        value = left * p0 + right * p1 + h * h / 6.0 * ((left**3 - left) * b0 + (right**3 - right) * b1)
        slope = (p1 - p0) / h + h / 6.0 * ((1.0 - 3.0 * left**2) * b0 + (3.0 * right**2 - 1.0) * b1)
        return value, slope, left * b0 + right * b1


def _slope(knots: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The slope (k,) at the first of four points, of the cubic through them."""
    x = knots - knots[0]
    return np.linalg.solve(np.vander(x, 4, increasing=True), points)[1]


def _bends(knots: np.ndarray, points: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Second derivatives (m, k) of the cubic spline with slopes (k,) at both ends (C. de Boor, A Practical Guide to
    Splines, chapter IV)."""
    h = np.diff(knots)
    slopes = np.diff(points, axis=0) / h[:, None]
    m = len(knots)
    system = np.zeros((m, m))
    i = np.arange(m)
    system[i, i] = 2.0 * (np.append(h, 0.0) + np.append(0.0, h))
    system[i[:-1], i[1:]] = system[i[1:], i[:-1]] = h
    return np.linalg.solve(system, 6.0 * np.diff(np.vstack([first, slopes, last]), axis=0))
