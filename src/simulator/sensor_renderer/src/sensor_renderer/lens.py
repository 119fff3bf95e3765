# SPDX-License-Identifier: BSD-3-Clause
"""Lenses that distort, by the model that ROS calls plumb_bob (Brown, "Decentering distortion of lenses", 1966, as
OpenCV documents it). ROS-free."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sensor_renderer.errors import SensorError
from sensor_renderer.pinhole import MAX_PIXELS, Pinhole

# The inverse is found by Newton's method; it is good when a ray hits its pixel within this distance [focal lengths].
_STEPS, _CLOSE = 30, 1e-9
# One pixel in so many is tried first.
_FEW = 101
# Pixels around the ideal picture, so that interpolation has neighbours everywhere.
_MARGIN_PX = 2


class Distortion(NamedTuple):
    """Coefficients in the order of ``sensor_msgs/CameraInfo.D``: radial k1, k2, tangential p1, p2, radial k3."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def distorted(self, rays: npt.ArrayLike) -> np.ndarray:
        """Where rays (n, 2), x / z and y / z in the optical frame, arrive in the picture [focal lengths]."""
        x, y = np.asarray(rays, dtype=float).T
        square = x * x + y * y
        radial = 1.0 + square * (self.k1 + square * (self.k2 + square * self.k3))
        return np.stack([x * radial + 2.0 * self.p1 * x * y + self.p2 * (square + 2.0 * x * x),
                         y * radial + self.p1 * (square + 2.0 * y * y) + 2.0 * self.p2 * x * y], axis=1)

    def rays(self, arrivals: npt.ArrayLike) -> np.ndarray:
        """The rays (n, 2) that arrive at ``arrivals`` (n, 2); ``ValueError`` if there is none, or if the picture folds
        over on the way there from its middle."""
        arrivals = np.asarray(arrivals, dtype=float)
        found = arrivals.copy()
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                off = self.distorted(found) - arrivals
                worst = np.abs(off).max(initial=0.0)
                if worst < _CLOSE or not np.isfinite(worst):
                    break
                found -= np.einsum("nij,nj->ni", _inverse(self._slope(found)), off)
            good = np.abs(self.distorted(found) - arrivals).max(initial=0.0) < _CLOSE
        if not good or any(_determinants(self._slope(part * found)).min(initial=1.0) <= 0.0
                           for part in np.linspace(0.0, 1.0, 11)):
            raise ValueError("no single ray arrives at each pixel")
        return found

    def _slope(self, rays):
        """The derivative (n, 2, 2) of :meth:`distorted`."""
        x, y = rays.T
        square = x * x + y * y
        radial = 1.0 + square * (self.k1 + square * (self.k2 + square * self.k3))
        growth = 2.0 * (self.k1 + square * (2.0 * self.k2 + 3.0 * square * self.k3))
        mixed = growth * x * y + 2.0 * (self.p1 * x + self.p2 * y)
        return np.stack([radial + growth * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x, mixed, mixed,
                         radial + growth * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x], axis=1).reshape(-1, 2, 2)


class Lens:
    """A camera whose lens distorts: an ideal camera that sees enough, and the way from its picture to this one's."""

    def __init__(self, pinhole: Pinhole, distortion: Distortion) -> None:
        """``pinhole``: size, focal lengths and principal point of the picture; raises :class:`SensorError` if the
        distortion is of no use there."""
        rows, columns = np.mgrid[0:pinhole.height, 0:pinhole.width].astype(float)
        arrivals = np.stack([(columns.ravel() - pinhole.cx) / pinhole.fx, (rows.ravel() - pinhole.cy) / pinhole.fy], 1)
        try:
            # A few show sooner than all that there is none.
            distortion.rays(arrivals[::_FEW])
            rays = distortion.rays(arrivals)
        except ValueError as error:
            raise SensorError("distortion %s is of no use for a picture of %d x %d: %s"
                              % (tuple(distortion), pinhole.width, pinhole.height, error)) from None
        places = rays * (pinhole.fx, pinhole.fy)
        left, top = (_MARGIN_PX - math.floor(low) for low in places.min(axis=0))
        width, height = (int(math.ceil(high)) + offset + _MARGIN_PX + 1
                         for high, offset in zip(places.max(axis=0), (left, top), strict=True))
        if max(width, height) > MAX_PIXELS:
            raise SensorError("distortion %s needs a picture of %d x %d pixels to choose from; expected at most %d"
                              % (tuple(distortion), width, height, MAX_PIXELS))
        #: The camera without distortion whose picture holds this one.
        self.ideal = Pinhole(width, height, pinhole.fx, pinhole.fy, float(left), float(top), pinhole.near, pinhole.far)
        size = pinhole.height, pinhole.width
        #: x / z and y / z (height, width) of the ray of each pixel.
        self.rays = rays[:, 0].reshape(size).astype(np.float32), rays[:, 1].reshape(size).astype(np.float32)
        places = (places + (left, top)).reshape(*size, 2)
        self._columns, self._rows = places[..., 0].astype(np.float32), places[..., 1].astype(np.float32)
        self._nearest = np.round(places[..., 1]).astype(int), np.round(places[..., 0]).astype(int)

    def picture(self, ideal: np.ndarray) -> np.ndarray:
        """The picture (height, width, 3), uint8, of the ideal camera's."""
        import cv2

        return cv2.remap(ideal, self._columns, self._rows, cv2.INTER_LINEAR)

    def nearest(self, ideal: np.ndarray) -> np.ndarray:
        """Values (height, width) of the ideal camera's, as depth, that must not be mixed at edges."""
        return ideal[self._nearest]


def _determinants(matrices):
    (a, b), (c, d) = matrices[:, 0].T, matrices[:, 1].T
    return a * d - b * c


def _inverse(matrices):
    (a, b), (c, d) = matrices[:, 0].T, matrices[:, 1].T
    return np.stack([d, -b, -c, a], axis=1).reshape(-1, 2, 2) / _determinants(matrices)[:, None, None]
