# SPDX-License-Identifier: BSD-3-Clause
"""The plane that most points of a cloud lie on, and what stands on it. Free of ROS."""
from typing import NamedTuple

import numpy as np


class NoPlane(Exception):
    """There is no plane among the points; the text says why."""


class Plane(NamedTuple):
    """The points p with `normal` (3,) . p = `distance` [m]; `inliers`: bool for each point that it was fitted to."""

    normal: np.ndarray
    distance: float
    inliers: np.ndarray

    def height(self, points):
        """(n,) how far points (n, 3) [m] are above the plane, on the side that its normal points to."""
        return np.asarray(points) @ self.normal - self.distance


def fit_plane(points, tolerance_m, upwards=(0.0, 0.0, 1.0), seed=0, tries=200):
    """The :class:`Plane` with the most points (n, 3) [m] within `tolerance_m`; its normal points `upwards`.

    Three points at a time are tried (Fischler and Bolles, "Random sample consensus", 1981); the best plane is then
    fitted to its points by least squares. Raises NoPlane.
    """
    points = np.asarray(points, dtype=float)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 3:
        raise NoPlane("%d points are too few for a plane; expected 3 or more" % len(points))
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
        raise NoPlane("no three of the %d points span a plane" % len(points))
    middle = points[best].mean(axis=0)
    _, _, axes = np.linalg.svd(points[best] - middle, full_matrices=False)
    normal = axes[2] if axes[2] @ upwards >= 0.0 else -axes[2]
    distance = float(normal @ middle)
    return Plane(normal, distance, np.abs(points @ normal - distance) < tolerance_m)
