# SPDX-License-Identifier: BSD-3-Clause
"""PID for k joints at once, with control_toolbox's meaning of the parameters. ROS-free; time is an argument."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from controller_manager.limits import Floats

from .errors import ControllerError


class Gains:
    """Arrays (k,): ``p``, ``i``, ``d``, ``i_min``, ``i_max``, and ``antiwindup`` (bool)."""

    def __init__(self, p: npt.ArrayLike, i: npt.ArrayLike, d: npt.ArrayLike, i_min: npt.ArrayLike, i_max: npt.ArrayLike,
                 antiwindup: npt.ArrayLike) -> None:
        self.p, self.i, self.d = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (p, i, d))
        self.i_min, self.i_max = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (i_min, i_max))
        self.antiwindup = np.atleast_1d(np.asarray(antiwindup, dtype=bool))

    @classmethod
    def from_params(cls, read: Callable[[str], tuple[Any, str]], names: Iterable[str]) -> Gains:
        """The gains under ``names`` (k parameter names, e.g. ``"gains/joint_1"``).

        ``read(name)`` -> (value or None, absolute name), e.g. ``ControllerContext.entry``. ``p`` is required.
        ``i_clamp`` [unit of the output] bounds the integral term on both sides, ``i_clamp_min`` and ``i_clamp_max``
        override it. Raises :class:`ControllerError`.
        """
        rows = [cls._row(read, name) for name in names]
        return cls(*zip(*rows, strict=True)) if rows else cls([], [], [], [], [], [])

    @classmethod
    def joined(cls, parts: Iterable[Gains]) -> Gains:
        """The gains of several :class:`Gains`, one after the other."""
        return cls(*(np.concatenate([getattr(part, field) for part in parts])
                     for field in ("p", "i", "d", "i_min", "i_max", "antiwindup")))

    @staticmethod
    def _row(read: Callable[[str], tuple[Any, str]], name: str) -> tuple[float, float, float, float, float, bool]:
        def number(key: str, default: float | None) -> float:
            value, full_name = read("%s/%s" % (name, key))
            if value is None:
                value = default
            if value is None:
                raise ControllerError("parameter %s is missing; give the proportional gain, e.g. "
                                      "{p: 100.0, i: 0.0, d: 1.0, i_clamp: 0.0}" % full_name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise ControllerError("parameter %s is %r, expected a number" % (full_name, value))
            return float(value)

        p, i, d = number("p", None), number("i", 0.0), number("d", 0.0)
        clamp = abs(number("i_clamp", 0.0))
        i_min, i_max = number("i_clamp_min", -clamp), number("i_clamp_max", clamp)
        if i_min > i_max:
            raise ControllerError("parameter %s: i_clamp_min %g is above i_clamp_max %g"
                                  % (read(name)[1], i_min, i_max))
        antiwindup, full_name = read(name + "/antiwindup")
        if antiwindup not in (None, True, False):
            raise ControllerError("parameter %s is %r, expected true or false" % (full_name, antiwindup))
        return p, i, d, i_min, i_max, bool(antiwindup)


class Pid:
    """One PID per joint. The output is p e + i-term + d de/dt.

    ``last_error``, ``last_error_dot``, ``integral``: arrays (k,) of the last update.
    Without antiwindup the i-term i * (integral of e) is clamped to [i_min, i_max]; with it, the integral itself is.
    """

    def __init__(self, gains: Gains) -> None:
        """``gains``: :class:`Gains` of k joints."""
        self.integral = np.zeros(len(gains.p))
        self.last_error = np.zeros(len(gains.p))
        self.last_error_dot = np.zeros(len(gains.p))
        self._take(gains)

    def change(self, k: int, p: float, i: float, d: float, i_min: float, i_max: float, antiwindup: bool) -> None:
        """Set other gains for joint ``k``; its integral and last error stay. Raises :class:`ControllerError`."""
        if i_min > i_max:
            raise ControllerError("the lower end of the integral term, %g, is above its upper end, %g" % (i_min, i_max))
        gains = Gains.joined([self.gains])
        gains.p[k], gains.i[k], gains.d[k], gains.i_min[k], gains.i_max[k] = p, i, d, i_min, i_max
        gains.antiwindup[k] = antiwindup
        self._take(gains)

    def terms(self, k: int) -> tuple[float, float, float]:
        """(proportional, integral, derivative) parts of the last output of joint ``k``, before it was set to 0 for
        an error that is not finite."""
        gains = self.gains
        integral = min(max(gains.i[k] * self.integral[k], gains.i_min[k]), gains.i_max[k])
        return gains.p[k] * self.last_error[k], integral, gains.d[k] * self.last_error_dot[k]

    def _take(self, gains: Gains) -> None:
        self.gains = gains
        self._bounded = gains.antiwindup & (gains.i != 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.where(self._bounded, gains.i_min / gains.i, 0.0), np.where(self._bounded, gains.i_max / gains.i,
                                                                                 0.0)
        self._low, self._high = np.minimum(*ends), np.maximum(*ends)
        self._low[~self._bounded], self._high[~self._bounded] = -np.inf, np.inf
        self._any_integral = bool(gains.i.any())

    def reset(self, index: Any = slice(None)) -> None:
        """Reset the state of all joints or of those in ``index``. The error before the first update counts as 0."""
        self.integral[index] = 0.0
        self.last_error[index] = 0.0
        self.last_error_dot[index] = 0.0

    def update(self, error: Floats, dt: float, error_dot: Any = None) -> Floats:
        """Output (k,) for ``error`` (k,); ``error_dot`` (k,) is differentiated from the errors when not given.

        0 when ``dt`` is not positive, and for joints whose error is not finite; these keep their state.
        """
        if not dt > 0.0:
            return np.zeros(len(error))
        gains = self.gains
        finite = np.isfinite(error)
        if error_dot is not None:
            finite &= np.isfinite(error_dot)
        every = finite.all()
        if not every:
            error = np.where(finite, error, 0.0)
            error_dot = None if error_dot is None else np.where(finite, error_dot, 0.0)
        if error_dot is None:
            error_dot = (error - self.last_error) / dt
        output = gains.p * error + gains.d * error_dot
        if self._any_integral:
            # A non-finite error was replaced by 0, so it adds nothing here.
            self.integral += error * dt
            np.maximum(self.integral, self._low, out=self.integral)
            np.minimum(self.integral, self._high, out=self.integral)
            output += np.minimum(np.maximum(gains.i * self.integral, gains.i_min), gains.i_max)
        if every:
            self.last_error, self.last_error_dot = np.array(error), np.array(error_dot)
            return output
        self.last_error = np.where(finite, error, self.last_error)
        self.last_error_dot = np.where(finite, error_dot, self.last_error_dot)
        return np.where(finite, output, 0.0)
