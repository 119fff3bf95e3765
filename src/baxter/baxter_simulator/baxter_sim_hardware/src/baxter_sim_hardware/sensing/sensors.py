# SPDX-License-Identifier: BSD-3-Clause
"""The robot's sensors: infrared range at the hands, the ring of sonars at the head, accelerometers in the hands."""

from __future__ import annotations

import math

import numpy as np

from baxter_sim_hardware.errors import CommandRefused

# Infrared range sensor of a hand: one ray along x of its frame [m, rad]; values of the physical robot.
RANGE_MIN_M, RANGE_MAX_M, RANGE_FIELD_RAD = 0.004, 0.4, 0.0872664600611
RANGE_NOTHING_M = 65.535  # its reading without an echo

# The ring: transducers at equal angles, the first straight ahead. Each one measures the nearest hit of its rays, half a
# beam's width above and below the horizon; the beam's width and the range are estimates, as the physical robot's are
# not public. The floor, 1.7 m below, is out of its range.
SONAR_COUNT = 12
SONAR_MIN_M, SONAR_MAX_M = 0.05, 10.0
SONAR_ELEVATIONS_RAD = (math.radians(-7.5), math.radians(7.5))
ALL_SONARS = (1 << SONAR_COUNT) - 1
LIGHTS_OVERRIDE = 0x8000  # bit of set_lights: low bits set the lights; without it they show echoes
LIGHTS_S = 0.2  # [simulated s] validity of one set_lights; clients repeat it at about 100 Hz
MAX_LEVEL = 100.0


def range_from_hit(distance: float | None) -> float:
    """Reading of a hand's sensor [m] for a ray that hits after `distance` [m], or not at all (None)."""
    return RANGE_NOTHING_M if distance is None else max(distance, RANGE_MIN_M)


def sonar_directions() -> np.ndarray:
    """(12, 2, 3) unit vectors in the ring's frame: for each transducer its two rays."""
    angles = 2.0 * math.pi * np.arange(SONAR_COUNT) / SONAR_COUNT
    return np.array([[(math.cos(angle) * math.cos(up), math.sin(angle) * math.cos(up), math.sin(up))
                      for up in SONAR_ELEVATIONS_RAD] for angle in angles])


class SonarRing:
    """Which sonars and lights are on."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.enabled = ALL_SONARS
        self.levels = {"green": 0.0, "red": 0.0}
        self._lights, self._lights_until = 0, 0.0

    def enable(self, mask: int) -> None:
        """Raises CommandRefused for bits that belong to no sonar."""
        if mask & ~ALL_SONARS:
            raise CommandRefused("sonars %d are to be enabled; it must be from 0 to %d" % (mask, ALL_SONARS))
        self.enabled = mask

    def set_lights(self, mask: int, time_s: float) -> None:
        """Set the lights by `mask` for LIGHTS_S if it has LIGHTS_OVERRIDE; else let them show echoes again."""
        self._lights = mask
        self._lights_until = time_s + LIGHTS_S if mask & LIGHTS_OVERRIDE else 0.0

    def overridden(self, time_s: float) -> int | None:
        """The mask that a client has set, if still valid at time_s [s], or None."""
        return self._lights if time_s < self._lights_until else None

    def set_level(self, colour: str, level: float) -> None:
        """Raises CommandRefused unless it is from 0 to 100."""
        if not 0.0 <= level <= MAX_LEVEL:
            raise CommandRefused("%s level is %g; it must be from 0 to %g" % (colour, level, MAX_LEVEL))
        self.levels[colour] = level

    def echoes(self, distances: np.ndarray) -> list[tuple[int, float]]:
        """[(sensor, distance [m])] of the sonars that are on, from (12,) distances, inf where nothing was hit."""
        return [(sensor, distance) for sensor, distance in enumerate(distances)
                if self.enabled >> sensor & 1 and SONAR_MIN_M <= distance <= SONAR_MAX_M]

    def heard(self, distances: np.ndarray) -> int:
        """A bit for each sonar with an echo among (12,) distances."""
        return sum(1 << sensor for sensor, _ in self.echoes(distances))


def specific_force(before: np.ndarray, after: np.ndarray, gravity: np.ndarray, rotation: np.ndarray,
                   dt: float) -> np.ndarray:
    """(3,) [m/s^2] reading of an accelerometer, in its own axes.

    before, after: (3,) velocity [m/s] of its frame in base around a tick of dt [s]; gravity: (3,) in base [m/s^2];
    rotation: (3, 3) from its axes to base.
    """
    return rotation.T @ ((after - before) / dt - gravity)
