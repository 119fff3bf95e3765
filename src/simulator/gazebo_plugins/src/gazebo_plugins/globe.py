# SPDX-License-Identifier: BSD-3-Clause
"""Converts world coordinates to latitude and longitude; the magnetic field. ROS-free."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

# WGS 84: equatorial radius [m] and flattening.
_RADIUS_M = 6378137.0
_FLATTENING = 1.0 / 298.257223563
_ECCENTRICITY_SQUARED = _FLATTENING * (2.0 - _FLATTENING)


class Reference:
    """Place of the world's origin on the globe: latitude and longitude [deg], altitude [m], and the heading of x [rad],
    clockwise from north."""

    def __init__(self, latitude: float, longitude: float, altitude: float = 0.0, heading: float = 0.0) -> None:
        self._latitude, self._longitude, self._altitude = latitude, longitude, altitude
        self._cosine, self._sine = math.cos(heading), math.sin(heading)
        bulge = 1.0 / (1.0 - _ECCENTRICITY_SQUARED * math.sin(math.radians(latitude)) ** 2)
        across = _RADIUS_M * math.sqrt(bulge)
        self._north_m = across * (1.0 - _ECCENTRICITY_SQUARED) * bulge  # radius of the meridian
        self._east_m = across * math.cos(math.radians(latitude))  # of the circle of latitude

    def north_west_up(self, vector: Iterable[float]) -> np.ndarray:
        """A vector (3,) of the world in these axes (3,)."""
        x, y, z = vector
        return np.array([self._cosine * x + self._sine * y, self._cosine * y - self._sine * x, z])

    def place(self, position: Iterable[float]) -> tuple[float, float, float]:
        """Latitude and longitude [deg] and altitude [m] of a ``position`` (3,) [m] of the world, as on a plane that
        touches the globe."""
        north, west, up = self.north_west_up(position)
        return (self._latitude + math.degrees(north / self._north_m),
                self._longitude - math.degrees(west / self._east_m), self._altitude + up)


def magnetic_field(magnitude: float, inclination: float, declination: float, heading: float) -> np.ndarray:
    """The field (3,) [as ``magnitude``] in world axes: it dips by ``inclination`` below the horizon and points
    ``declination`` east of north; x of the world looks ``heading`` clockwise from north. All in [rad]."""
    level = magnitude * math.cos(inclination)
    return np.array([level * math.cos(heading - declination), level * math.sin(heading - declination),
                     -magnitude * math.sin(inclination)])
