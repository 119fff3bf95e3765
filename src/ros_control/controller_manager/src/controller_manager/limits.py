# SPDX-License-Identifier: BSD-3-Clause
"""Joint limits: reading them, and enforcing them on commands. ROS-free, all joints of an interface at once.

The rules are joint_limits_interface's: saturation, or soft limits for joints whose URDF has a <safety_controller>.
"""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import HardwareError

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SoftLimits:
    """A <safety_controller>: soft range [rad or m], k_position [1/s], k_velocity [N m s/rad or N s/m]."""

    lower: float
    upper: float
    k_position: float
    k_velocity: float


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint; infinite means no limit. ``soft``: :class:`SoftLimits` or None; they need a velocity
    limit."""

    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf
    soft: SoftLimits | None = None


def limits_from_urdf(joint: Any, soft: SoftLimits | None = None) -> JointLimits:
    """The limits of a ``urdf_model.Joint``; a continuous joint has no position limits."""
    limit = joint.limit

    def value(number: float | None, absent: float = math.inf) -> float:
        return absent if number is None else number

    if joint.type == "continuous":
        return JointLimits(velocity=value(limit.velocity), effort=value(limit.effort), soft=soft)
    return JointLimits(value(limit.lower, -math.inf), value(limit.upper), value(limit.velocity), math.inf,
                       value(limit.effort), soft)


def without_idle_soft_limits(limits: JointLimits) -> JointLimits:
    """``limits`` without soft limits if the velocity limit is missing, since they need it."""
    if limits.soft is not None and math.isinf(limits.velocity):
        return dataclasses.replace(limits, soft=None)
    return limits


def with_parameters(limits: JointLimits, values: Any, source: str) -> JointLimits:
    """``limits``, with those in the mapping ``values`` (a joint's entry under ``joint_limits``) replaced.

    ``has_position_limits``, ``has_velocity_limits``, ``has_acceleration_limits``, ``has_effort_limits``: true needs the
    values (``min_position``, ``max_position``, ``max_velocity`` ...), false removes the limit. ``source``: name of
    the parameter, for messages. Raises :class:`HardwareError`.
    """
    if not isinstance(values, dict):
        raise HardwareError("parameter %s is %r, expected a mapping such as {has_velocity_limits: true, "
                            "max_velocity: 1.0}" % (source, values))
    changes = {}
    for switch, keys in (("has_position_limits", {"min_position": "lower", "max_position": "upper"}),
                         ("has_velocity_limits", {"max_velocity": "velocity"}),
                         ("has_acceleration_limits", {"max_acceleration": "acceleration"}),
                         ("has_effort_limits", {"max_effort": "effort"})):
        wanted = values.get(switch)
        if wanted is None:
            continue
        if not isinstance(wanted, bool):
            raise HardwareError("parameter %s/%s is %r, expected true or false" % (source, switch, wanted))
        for key, field in keys.items():
            changes[field] = _number(values, key, source) if wanted else -math.inf if field == "lower" else math.inf
    if values.get("angle_wraparound") is True and not values.get("has_position_limits"):
        changes["lower"], changes["upper"] = -math.inf, math.inf
    changed = dataclasses.replace(limits, **changes)
    if changed.lower > changed.upper:
        raise HardwareError("parameter %s: min_position %g is above max_position %g"
                            % (source, changed.lower, changed.upper))
    return changed


def _number(values: dict[str, Any], key: str, source: str) -> float:
    number = values.get(key)
    if isinstance(number, bool) or not isinstance(number, (int, float)) or not math.isfinite(number):
        raise HardwareError("parameter %s/%s is %r, expected a number" % (source, key, number))
    if key not in ("min_position", "max_position") and number < 0.0:
        raise HardwareError("parameter %s/%s is %g, expected 0 or more" % (source, key, number))
    return float(number)


class _Columns:
    """The limits of k joints as arrays (k,), and which joints have soft ones."""

    def __init__(self, limits: Sequence[JointLimits]) -> None:
        self.lower, self.upper, self.velocity, self.acceleration, self.effort = (
            np.array([getattr(limit, field) for limit in limits], dtype=float)
            for field in ("lower", "upper", "velocity", "acceleration", "effort"))
        soft = [k for k, limit in enumerate(limits) if limit.soft is not None]
        self.soft = np.array(soft, dtype=int)
        self.has_soft = bool(soft)
        self.soft_lower, self.soft_upper, self.k_position, self.k_velocity = (
            np.array([getattr(limits[k].soft, field) for k in soft])
            for field in ("lower", "upper", "k_position", "k_velocity"))
        self.soft_velocity = self.velocity[self.soft]

    def soft_velocity_range(self, position: Floats) -> tuple[Floats, Floats]:
        """Lowest and highest velocity of the soft joints at ``position`` (of the soft joints)."""
        fastest = self.soft_velocity
        low = np.minimum(np.maximum(-self.k_position * (position - self.soft_lower), -fastest), fastest)
        high = np.minimum(np.maximum(-self.k_position * (position - self.soft_upper), -fastest), fastest)
        return low, high


class PositionLimiter:
    """Position commands: within the range, and no faster than the velocity limit from one command to the next.

    Open loop: relative to its own last command, not to the measured position.
    """

    def __init__(self, limits: Sequence[JointLimits]) -> None:
        """``limits``: list of :class:`JointLimits`."""
        self._columns = _Columns(limits)
        self._last: Floats | None = None

    def reset(self) -> None:
        """Start from the measured position at the next call."""
        self._last = None

    def enforce(self, command: Floats, dt: float, position: Floats, velocity: Floats) -> Floats:
        """The part (k,) that may be commanded of ``command`` (k,); ``position``, ``velocity`` (k,) are measured."""
        columns = self._columns
        last = position if self._last is None else self._last
        reach = columns.velocity * dt
        low, high = np.maximum(last - reach, columns.lower), np.minimum(last + reach, columns.upper)
        if columns.has_soft:
            soft = columns.soft
            slowest, fastest = columns.soft_velocity_range(last[soft])
            # Only a joint with a range has limits to keep.
            ranged = np.isfinite(columns.lower[soft]) & np.isfinite(columns.upper[soft])
            slowest = np.where(ranged, slowest, -columns.soft_velocity)
            fastest = np.where(ranged, fastest, columns.soft_velocity)
            low[soft] = np.maximum(last[soft] + slowest * dt, columns.lower[soft])
            high[soft] = np.minimum(last[soft] + fastest * dt, columns.upper[soft])
        self._last = np.minimum(np.maximum(command, low), high)
        return self._last


class VelocityLimiter:
    """Velocity commands: within the velocity limit, and the acceleration limit where there is one."""

    def __init__(self, limits: Sequence[JointLimits]) -> None:
        self._columns = _Columns(limits)
        self._accelerates = bool(np.isfinite(self._columns.acceleration).any())
        self._last = np.zeros(len(limits))

    def reset(self) -> None:
        """Start from velocity zero at the next call."""
        self._last = np.zeros(len(self._last))

    def enforce(self, command: Floats, dt: float, position: Floats, velocity: Floats) -> Floats:
        """The part (k,) that may be commanded of ``command`` (k,); ``position``, ``velocity`` (k,) are measured."""
        columns = self._columns
        low, high = -columns.velocity, columns.velocity
        if columns.has_soft:
            soft = columns.soft
            low, high = low.copy(), high.copy()
            ranged = np.isfinite(columns.lower[soft]) & np.isfinite(columns.upper[soft])
            slowest, fastest = columns.soft_velocity_range(position[soft])
            low[soft] = np.where(ranged, slowest, low[soft])
            high[soft] = np.where(ranged, fastest, high[soft])
        if self._accelerates:
            # Soft limits use the measured velocity, saturation the last command.
            base = self._last
            if columns.has_soft:
                base = base.copy()
                base[columns.soft] = velocity[columns.soft]
            change = columns.acceleration * dt
            low, high = np.maximum(low, base - change), np.minimum(high, base + change)
        self._last = np.minimum(np.maximum(command, low), high)
        return self._last


class EffortLimiter:
    """Effort commands: within the effort limit, and never driving a joint further beyond its other limits."""

    def __init__(self, limits: Sequence[JointLimits]) -> None:
        self._columns = _Columns(limits)

    def reset(self) -> None:
        """Has no state to reset."""

    def enforce(self, command: Floats, dt: float, position: Floats, velocity: Floats) -> Floats:
        """The part (k,) that may be commanded of ``command`` (k,); ``position``, ``velocity`` (k,) are measured."""
        columns = self._columns
        low = np.where((position < columns.lower) | (velocity < -columns.velocity), 0.0, -columns.effort)
        high = np.where((position > columns.upper) | (velocity > columns.velocity), 0.0, columns.effort)
        if columns.has_soft:
            soft, effort = columns.soft, columns.effort[columns.soft]
            slowest, fastest = columns.soft_velocity_range(position[soft])
            ranged = np.isfinite(columns.lower[soft]) & np.isfinite(columns.upper[soft])
            slowest = np.where(ranged, slowest, -columns.soft_velocity)
            fastest = np.where(ranged, fastest, columns.soft_velocity)
            low[soft] = np.clip(-columns.k_velocity * (velocity[soft] - slowest), -effort, effort)
            high[soft] = np.clip(-columns.k_velocity * (velocity[soft] - fastest), -effort, effort)
        return np.minimum(np.maximum(command, low), high)
