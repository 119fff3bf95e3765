# SPDX-License-Identifier: BSD-3-Clause
"""Joint commands: modes, limits, and the checks of a message before it moves anything.

A command is one decision: it is refused as a whole (`CommandRefused`) when it is malformed, and clamped, value by
value, when it exceeds the joints' limits. The physical robot does the same; its own tucked pose, for one, lies 0.03 rad
outside the URDF's limits.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from baxter_sim_hardware.errors import CommandRefused
from command_line.options import counted
from disk_cache.compiled import compiler

if TYPE_CHECKING:
    from collections.abc import Sequence

_compiled = compiler("baxter_sim_hardware", [__file__], error_model="numpy")


class Mode(IntEnum):
    """JointCommand.mode on the wire."""

    POSITION = 1
    VELOCITY = 2
    TORQUE = 3
    RAW_POSITION = 4


_UNITS = {Mode.POSITION: "rad", Mode.VELOCITY: "rad/s", Mode.TORQUE: "Nm", Mode.RAW_POSITION: "rad"}


@_compiled
def _clamp(index: np.ndarray, values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
    """Bring values (k,) of joints `index` (k,) inside lower and upper (n,); returns whether one was outside."""
    is_outside = False
    for i, joint in enumerate(index):
        inside = min(max(values[i], lower[joint]), upper[joint])
        is_outside |= inside != values[i]
        values[i] = inside
    return is_outside


@dataclass(frozen=True)
class ArmLimits:
    """Limits of n joints, from the robot's URDF.

    lower, upper: (n,) [rad]; velocity: (n,) [rad/s]; effort: (n,) [Nm].
    """

    names: tuple
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray

    def __post_init__(self) -> None:
        for field in ("lower", "upper", "velocity", "effort"):
            value = np.array(getattr(self, field), dtype=float)
            if value.shape != (len(self.names),):
                raise ValueError("%s has shape %s, expected (%d,)" % (field, value.shape, len(self.names)))
            value.setflags(write=False)
            object.__setattr__(self, field, value)

    def clamp(self, mode: Mode, index: np.ndarray, values: np.ndarray) -> bool:
        """Bring `values` of the joints `index` inside what `mode` allows; returns whether one was outside."""
        if mode is Mode.VELOCITY:
            return _clamp(index, values, -self.velocity, self.velocity)
        if mode is Mode.TORQUE:
            return _clamp(index, values, -self.effort, self.effort)
        return _clamp(index, values, self.lower, self.upper)


# A joint at its limit is measured slightly beyond it, and clients that start from the measured position send such
# values.
WORTH_TELLING = 1e-3  # [rad, rad/s or Nm]


@dataclass(frozen=True)
class CheckedCommand:
    """A checked command. index: (k,) ints into the limits' joints; values: (k,) [rad, rad/s or Nm by mode]."""

    mode: Mode
    index: np.ndarray
    values: np.ndarray
    clamped: tuple = ()  # a text for each joint that was out of range by more than WORTH_TELLING


class CommandParser:
    """Turns the fields of a JointCommand message for one limb into a `CheckedCommand`.

    limits: of all joints that the indices count in; names: the joints that this limb accepts.
    """

    def __init__(self, limits: ArmLimits, names: Sequence[str]) -> None:
        self._limits = limits
        self._names = tuple(names)
        self._index = {name: limits.names.index(name) for name in names}
        self._last = [], np.zeros(0, dtype=int)  # the last valid names, and their indices

    def parse(self, mode: int, names: Sequence[str], values: Sequence[float]) -> CheckedCommand:
        """Check one command.

        mode: int; names: sequence of str; values: sequence of float, one for each name.
        Raises CommandRefused, with the error and what this limb accepts.
        """
        self._check(mode, names, values)
        mode, index = Mode(mode), self._last[1]
        inside = np.array(values, dtype=float)
        clamped = ()
        if self._limits.clamp(mode, index, inside):
            outside = np.abs(inside - values) > WORTH_TELLING
            clamped = tuple("%s: %.5g became %.5g %s" % (names[i], values[i], inside[i], _UNITS[mode])
                            for i in np.flatnonzero(outside))
        return CheckedCommand(mode, index, inside, clamped)

    def _check(self, mode: int, names: Sequence[str], values: Sequence[float]) -> None:
        """Raises CommandRefused; else `_last` holds the command's joints."""
        if mode not in Mode._value2member_map_:
            raise self._refusal("unknown mode %d; modes are %s" % (
                mode, ", ".join("%d %s" % (known, known.name) for known in Mode)))
        if len(names) != len(values):
            raise self._refusal("%s but %s, and each name needs one value" % (
                counted(len(names), "name"), counted(len(values), "value")))
        if not names:
            raise self._refusal("no joints named")
        names = list(names)
        # A stream repeats the same names.
        if names != self._last[0]:
            unknown = [name for name in names if name not in self._index]
            if unknown:
                raise self._refusal("unknown joint '%s'" % unknown[0])
            if len(set(names)) != len(names):
                repeated = sorted(name for name, count in Counter(names).items() if count > 1)
                raise self._refusal("%s named more than once" % ", ".join(repeated))
            index = np.array([self._index[name] for name in names])
            index.setflags(write=False)
            self._last = names, index
        if not math.isfinite(sum(values)):  # the sum of finite values may overflow, too
            for name, value in zip(names, values, strict=True):
                if not math.isfinite(value):
                    raise self._refusal("the value for %s is %s, and it must be a finite number" % (name, value))

    def _refusal(self, fault: str) -> CommandRefused:
        return CommandRefused("%s; this limb's joints are %s" % (fault, ", ".join(self._names)))
