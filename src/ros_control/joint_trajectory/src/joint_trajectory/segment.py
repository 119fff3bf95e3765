# SPDX-License-Identifier: BSD-3-Clause
"""Polynomials between points: linear, cubic or quintic.

A polynomial of k joints is an array (6, k): row i holds the coefficients of s**i, with s [s] the time since its start.
Everything here works on m polynomials at once, (m, 6, k).
"""
from __future__ import annotations

import numpy as np
import numpy.typing as npt

#: Shapes and units are in the docstrings.
Floats = npt.NDArray[np.float64]

# Degree of the polynomial that a point's fields allow: positions alone, with velocities, with accelerations too.
LINEAR, CUBIC, QUINTIC = 1, 3, 5

# Pascal's triangle: row i, column j is "i over j".
_BINOMIAL = np.array([[1, 0, 0, 0, 0, 0], [1, 1, 0, 0, 0, 0], [1, 2, 1, 0, 0, 0], [1, 3, 3, 1, 0, 0],
                      [1, 4, 6, 4, 1, 0], [1, 5, 10, 10, 5, 1]], dtype=float)
_POWERS = np.subtract.outer(np.arange(6), np.arange(6)).clip(0)


def splines(times: Floats, positions: Floats, velocities: Floats, accelerations: Floats,
            degrees: npt.NDArray[np.int_]) -> Floats:
    """The m - 1 polynomials through m points: (m - 1, 6, k).

    ``times`` (m,) [s], strictly increasing; ``positions``, ``velocities``, ``accelerations`` (m, k); ``degrees`` (m,)
    of LINEAR, CUBIC, QUINTIC says which of the fields of a point count. The end with fewer fields decides the degree of
    a segment. The coefficients solve position, velocity and acceleration at both ends (cubic, quintic Hermite
    interpolation).
    """
    duration = np.diff(times)[:, None]
    degree = np.minimum(degrees[:-1], degrees[1:])
    distance = positions[1:] - positions[:-1]
    coefficients = np.zeros((len(duration), 6, positions.shape[1]))
    coefficients[:, 0] = positions[:-1]

    at = degree == LINEAR
    coefficients[at, 1] = distance[at] / duration[at]

    at = degree == CUBIC
    t, d = duration[at], distance[at]
    v0, v1 = velocities[:-1][at], velocities[1:][at]
    coefficients[at, 1] = v0
    coefficients[at, 2] = (3.0 * d / t - 2.0 * v0 - v1) / t
    coefficients[at, 3] = (-2.0 * d / t + v0 + v1) / t**2

    at = degree == QUINTIC
    t, d = duration[at], distance[at]
    v0, v1 = velocities[:-1][at], velocities[1:][at]
    a0, a1 = accelerations[:-1][at], accelerations[1:][at]
    coefficients[at, 1] = v0
    coefficients[at, 2] = a0 / 2.0
    coefficients[at, 3] = (20.0 * d - (12.0 * v0 + 8.0 * v1) * t - (3.0 * a0 - a1) * t**2) / (2.0 * t**3)
    coefficients[at, 4] = (-30.0 * d + (16.0 * v0 + 14.0 * v1) * t + (3.0 * a0 - 2.0 * a1) * t**2) / (2.0 * t**4)
    coefficients[at, 5] = (12.0 * d - (6.0 * v0 + 6.0 * v1) * t - (a0 - a1) * t**2) / (2.0 * t**5)
    return coefficients


def smooth_velocities(times: Floats, positions: Floats) -> Floats:
    """Velocities (m, k) with which cubics through ``positions`` (m, k) do not overshoot; 0 at both ends.

    At a turning point 0, else the harmonic mean of the slopes beside it (F. N. Fritsch, J. Butland 1984).
    """
    slopes = np.diff(positions, axis=0) / np.diff(times)[:, None]
    before, after = slopes[:-1], slopes[1:]
    product = before * after
    velocities = np.zeros_like(positions)
    np.divide(2.0 * product, before + after, out=velocities[1:-1], where=product > 0.0)
    return velocities


def constant(position: npt.ArrayLike) -> Floats:
    """The polynomial (6, k) that stays at ``position`` (k,)."""
    position = np.asarray(position, dtype=float)
    coefficients = np.zeros((6, len(position)))
    coefficients[0] = position
    return coefficients


def shifted(coefficients: Floats, delay: npt.ArrayLike) -> Floats:
    """The same curves, (m, 6, k), with time counted from ``delay`` (m,) [s] after their start."""
    # Taylor: the new coefficient j is the sum over i >= j of (i over j) delay**(i - j) c_i.
    matrices = _BINOMIAL * np.asarray(delay, dtype=float)[:, None, None] ** _POWERS
    return np.einsum("mij,mik->mjk", matrices, coefficients)
