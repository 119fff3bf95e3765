# SPDX-License-Identifier: BSD-3-Clause
"""The plane that most points of a cloud lie on, and what stands on it. Free of ROS."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from command_line.options import counted

# So often a plane is fitted at most; a few times are usual.
_MAX_FITS = 20


class NoPlane(Exception):
    """There is no plane among the points; the text says why."""


class FittedPlane(NamedTuple):
    """The points p with `normal` (3,) . p = `distance` [m]; `inliers`: bool for each point that it was fitted to."""

    normal: np.ndarray
    distance: float
    inliers: np.ndarray

    def height(self, points: npt.ArrayLike) -> np.ndarray:
        """(n,) how far points (n, 3) [m] are above the plane, on the side that its normal points to."""
        return np.asarray(points) @ self.normal - self.distance


def fit_plane(points: npt.ArrayLike, tolerance_m: float, upwards: Sequence[float] = (0.0, 0.0, 1.0), seed: int = 0,
              tries: int = 200) -> FittedPlane:
    """The :class:`FittedPlane` with the most points (n, 3) [m] within `tolerance_m`; its normal points `upwards`.

    Three points at a time are tried (Fischler and Bolles, "Random sample consensus", 1981); the best plane is then
    fitted to the points near it by least squares, again and again until these stay the same. Raises NoPlane.
    """
    points = np.asarray(points, dtype=float)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 3:
        raise NoPlane("%s are too few for a plane; expected 3 or more" % counted(len(points), "point"))
    random = np.random.default_rng(seed)
    best = None
    for three in random.integers(len(points), size=(tries, 3)):
        a, b, c = points[three]
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        if length < 1e-9:
            continue
        inliers = np.abs((points - a) @ (normal / length)) < tolerance_m
        if best is None or inliers.sum() > best.sum():
            best = inliers
    if best is None or best.sum() < 3:
        raise NoPlane("no three of the %s span a plane" % counted(len(points), "point"))
    # Fitted again to the points near the fitted plane: a plane through three noisy points is tilted, and so are the
    # borders of the points near it.
    for _ in range(_MAX_FITS):
        plane = _fitted(points, best, upwards, tolerance_m)
        if (plane.inliers == best).all() or plane.inliers.sum() < 3:
            break
        best = plane.inliers
    return plane


def _fitted(points, chosen, upwards, tolerance_m):
    """The FittedPlane by least squares through the ``chosen`` points; its inliers are those of all points."""
    middle = points[chosen].mean(axis=0)
    _, _, axes = np.linalg.svd(points[chosen] - middle, full_matrices=False)
    normal = axes[2] if axes[2] @ upwards >= 0.0 else -axes[2]
    distance = float(normal @ middle)
    return FittedPlane(normal, distance, np.abs(points @ normal - distance) < tolerance_m)
