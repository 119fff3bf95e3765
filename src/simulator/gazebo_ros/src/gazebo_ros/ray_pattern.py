# SPDX-License-Identifier: BSD-3-Clause
"""The ``<ray>`` element of a laser or range finder, and a scan that is cast a few rays at a time. ROS-free."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

#: Largest number of rays per tick [about 5 us each]: a larger scan takes several ticks, as a real scanner's sweep does.
RAYS_PER_TICK = 32
_MAX_RAYS = 100000
# Of all numbers of a ray, which messages have in 32 bits.
_MOST = 1e9
_ONCE_ROUND = 2.0 * math.pi + 0.01  # [rad]; descriptions round it up


class RayPatternError(Exception):
    """A ``<ray>`` that cannot be used; the text says what was found and what would be right."""


class RayPattern:
    """Directions and ranges of a ray sensor; its x looks ahead, z is up.

    Attributes: ``directions`` (rows * columns, 3), row by row from the lowest; ``angle_min``, ``angle_max``,
    ``increment`` [rad] of a row; ``range_min``, ``range_max`` [m]; ``noise`` [m], a standard deviation; ``field``
    [rad], the wider of both angles; ``remarks``: texts about angles that Gazebo takes and that are rarely meant.
    """

    def __init__(self, ray: Any, what: str) -> None:
        """``ray``: the element, or None for SDF's defaults; ``what`` names the sensor in messages. Raises
        :class:`RayPatternError`."""
        self._ray, self._what, self.remarks = ray, what, []
        self.columns, self.angle_min, self.angle_max = self._span("scan/horizontal", 640)
        self.rows, low, high = self._span("scan/vertical", 1)
        if self.rows * self.columns > _MAX_RAYS:
            raise RayPatternError("%s casts %d rays; expected at most %d"
                                  % (what, self.rows * self.columns, _MAX_RAYS))
        self.range_min, self.range_max = self._number("range/min", 0.0), self._number("range/max", 10.0)
        if not 0.0 <= self.range_min < self.range_max:
            raise RayPatternError("%s reaches from %g to %g m; expected 0 <= min < max"
                                  % (what, self.range_min, self.range_max))
        self.noise = max(self._number("noise/stddev", 0.0), 0.0)
        self.increment = (self.angle_max - self.angle_min) / (self.columns - 1) if self.columns > 1 else 0.0
        self.field = max(abs(self.angle_max - self.angle_min), abs(high - low))
        yaw, pitch = np.meshgrid(_angles(self.columns, self.angle_min, self.angle_max), _angles(self.rows, low, high))
        self.directions = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)],
                                   axis=-1).reshape(-1, 3)

    def _span(self, path: str, default_samples: int) -> tuple[int, float, float]:
        samples = round(self._number(path + "/samples", default_samples) * self._number(path + "/resolution", 1.0))
        low, high = self._number(path + "/min_angle", 0.0), self._number(path + "/max_angle", 0.0)
        # Scanners that turn continuously are described either from 0 to 2 pi or from -pi to pi.
        if samples < 1:
            raise RayPatternError("%s: %s has %d samples; expected at least one" % (self._what, path, samples))
        if abs(high - low) > _ONCE_ROUND:
            self.remarks.append("%s: %s goes from %g to %g rad, more than once round; angles are in rad"
                                % (self._what, path, low, high))
        return samples, low, high

    def _number(self, path: str, default: float) -> float:
        text = ("" if self._ray is None else self._ray.findtext(path) or "").strip()
        try:
            value = float(text) if text else float(default)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise RayPatternError("%s: <%s> is '%s', expected a number" % (self._what, path, text))
        used = min(max(value, -_MOST), _MOST)
        if used != value:
            self.remarks.append("%s: <%s> is %g, for which %g is used" % (self._what, path, value, used))
        return used


class Sweep:
    """One scan in the making."""

    def __init__(self, pattern: RayPattern, cast: Callable[[np.ndarray, np.ndarray], np.ndarray],
                 random: np.random.Generator) -> None:
        """``cast(starts, ends)`` -> fractions (k,) at which rays from (k, 3) to (k, 3) hit, 1.0 for no hit; ``random``:
        ``numpy.random.Generator`` for noise."""
        self._pattern = pattern
        self._cast = cast
        self._random = random
        self._ranges = np.empty(len(pattern.directions))
        self._done = 0

    def go_on(self, pose: np.ndarray) -> np.ndarray | None:
        """Cast the next rays from a sensor at ``pose`` (4, 4). Returns the ranges (n,) [m] if the scan is now complete,
        infinite for rays that hit nothing, else None."""
        pattern = self._pattern
        end = min(self._done + RAYS_PER_TICK, len(self._ranges))
        directions = pattern.directions[self._done:end] @ pose[:3, :3].T
        starts = pose[:3, 3] + directions * pattern.range_min
        fractions = self._cast(starts, pose[:3, 3] + directions * pattern.range_max)
        ranges = pattern.range_min + fractions * (pattern.range_max - pattern.range_min)
        if pattern.noise:
            ranges = np.clip(ranges + self._random.normal(0.0, pattern.noise, len(ranges)), pattern.range_min,
                             pattern.range_max)
        ranges[fractions >= 1.0] = math.inf
        self._ranges[self._done:end] = ranges
        self._done = end
        if end < len(self._ranges):
            return None
        self._done = 0
        return self._ranges.copy()


def _angles(count: int, low: float, high: float) -> np.ndarray:
    return np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2.0])
