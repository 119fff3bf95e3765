# SPDX-License-Identifier: BSD-3-Clause
"""Cubic splines through points, as Bezier curves: the functions that programs for the robot's SDK import.

N + 1 points (one row each, k columns, one for each dimension) lie at the parameters 0, 1, ... N of a cubic B-spline
with continuous second derivative; each of its N pieces is a Bezier curve of four points. The server does not use this:
it knows the times of the points. Free of ROS. (Source: G. Farin, Curves and Surfaces for CAGD, cubic spline
interpolation.)
"""
from __future__ import annotations

from typing import Any

import numpy as np


def de_boor_control_pts(points_array: np.ndarray, d0: list[float] | None = None, dN: Any | None = None,
                        natural: bool = True) -> np.ndarray:
    """Control points (N + 3, k) of the spline through `points_array` (N + 1, k).

    The first and the last are those of the points. `d0` and `dN` (k,) are the ones next to them; where one is not given
    it follows from `natural`: no curvature at that end; otherwise it is the end point itself, for a curve that begins,
    or ends, at rest. Raises ValueError for fewer than two points.
    """
    points = np.atleast_2d(np.asarray(points_array, dtype=float))
    pieces = len(points) - 1
    if pieces < 1:
        raise ValueError("a spline needs two points or more, got %d" % len(points))
    weights = _inner_weights(pieces)
    system = np.zeros((pieces + 1, pieces + 1))
    right = points.copy()
    for joint in range(1, pieces):
        # A point between two pieces lies halfway between its Bezier neighbours.
        system[joint, joint - 1:joint + 1] += weights[joint - 1, 1] / 2.0
        system[joint, joint:joint + 2] += weights[joint, 0] / 2.0
    for row, piece, near, given in ((0, 0, 0, d0), (pieces, pieces - 1, 1, dN)):
        if given is None and natural:
            # Second difference zero: end = 2 (nearer Bezier point) - (farther one).
            system[row, piece:piece + 2] = 2.0 * weights[piece, near] - weights[piece, 1 - near]
        else:
            system[row, row] = 1.0
            if given is not None:
                right[row] = given
    return np.vstack([points[:1], np.linalg.solve(system, right), points[-1:]])


def bezier_coefficients(points_array: np.ndarray, d_pts: np.ndarray) -> np.ndarray:
    """Bezier points (k, N, 4) of the N pieces, from the points (N + 1, k) and their de_boor_control_pts (N + 3, k)."""
    points = np.atleast_2d(np.asarray(points_array, dtype=float))
    control = np.asarray(d_pts, dtype=float)[1:-1]
    inner = np.einsum("pij,pjk->kpi", _inner_weights(len(points) - 1), np.stack([control[:-1], control[1:]], axis=1))
    return np.concatenate([points[:-1].T[:, :, None], inner, points[1:].T[:, :, None]], axis=2)


def bezier_point(b_coeffs: np.ndarray, b_index: int, t: float) -> np.ndarray:
    """The point (k,) of piece `b_index`, 1 to N, at its parameter `t`, 0 to 1.

    Index 0 and less is the start of the curve, above N its end. `b_coeffs` (k, N, 4): bezier_coefficients.
    """
    if b_index <= 0:
        return b_coeffs[:, 0, 0]
    if b_index > b_coeffs.shape[1]:
        return b_coeffs[:, -1, 3]
    s = 1.0 - t
    return b_coeffs[:, b_index - 1] @ np.array([s**3, 3.0 * t * s**2, 3.0 * t**2 * s, t**3])


def bezier_curve(b_coeffs: np.ndarray, num_intervals: int) -> np.ndarray:
    """Points (N num_intervals + 1, k) along the whole curve, `num_intervals` from each of the N pieces."""
    pieces = b_coeffs.shape[1]
    points = [bezier_point(b_coeffs, piece + 1, step / num_intervals)
              for piece in range(pieces) for step in range(num_intervals)]
    return np.array([*points, bezier_point(b_coeffs, pieces + 1, 0.0)])


def _inner_weights(pieces: int) -> np.ndarray:
    """(N, 2, 2): what the two control points about each piece weigh in its two inner Bezier points.

    The knots are 1 apart, and those beyond the ends fall on the ends.
    """
    before, after = np.ones(pieces), np.ones(pieces)
    before[0] = after[-1] = 0.0
    return np.stack([np.stack([1.0 + after, before], axis=1), np.stack([after, 1.0 + before], axis=1)],
                    axis=1) / (before + 1.0 + after)[:, None, None]
