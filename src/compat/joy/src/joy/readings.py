# SPDX-License-Identifier: BSD-3-Clause
"""Positions of a joystick's axes and buttons, from the kernel's events (linux/joystick.h)."""
from __future__ import annotations

import struct
from typing import Any

_EVENT = struct.Struct("=IhBB")  # time [ms], value, type, number of the stick's axis or button
_BUTTON, _AXIS, _INITIAL = 0x01, 0x02, 0x80
_FULL = 32767.0  # reading of a stick at its end

LARGEST_DEADZONE = 0.9


class Readings:
    """The present state: `axes`, list of -1..1, left and up positive; `buttons`, list of 0 or 1.

    deadzone: share of a stick's travel, 0 to 0.9, within which it reads 0. Raises ValueError for one out of range.
    """

    def __init__(self, deadzone: float = 0.05) -> None:
        if not 0.0 <= deadzone <= LARGEST_DEADZONE:
            raise ValueError("deadzone is %s; it must be from 0 to %g" % (deadzone, LARGEST_DEADZONE))
        self._deadzone = deadzone
        self.restart(0, 0)

    def restart(self, axes: int, buttons: int) -> None:
        """Start with this many axes and buttons, all at rest; the lists grow when an event names more."""
        self._rest = b""  # the start of an incomplete event
        self.axes: list[float] = [0.0] * axes
        self.buttons: list[int] = [0] * buttons

    def take(self, data: bytes) -> tuple[bool, bool]:
        """Take the bytes read; events may be split anywhere.

        Returns (whether anything has changed, whether a button was pressed or released by hand).
        """
        data = self._rest + data
        whole = len(data) - len(data) % _EVENT.size
        self._rest = data[whole:]
        changed = pressed = False
        for _, value, kind, number in _EVENT.iter_unpack(data[:whole]):
            if kind & ~_INITIAL == _BUTTON:
                changed |= _put(self.buttons, number, int(value != 0), 0)
                pressed |= not kind & _INITIAL
            elif kind & ~_INITIAL == _AXIS:
                changed |= _put(self.axes, number, self._scaled(value), 0.0)
        return changed, changed and pressed

    def _scaled(self, value: float) -> float:
        share = max(-1.0, -value / _FULL)  # the kernel counts right and down as positive
        beyond = max(0.0, abs(share) - self._deadzone) / (1.0 - self._deadzone)
        return min(beyond, 1.0) if share > 0.0 else -min(beyond, 1.0) or 0.0


def _put(values: list[Any], number: int, value: float, empty: float) -> bool:
    """Put a value into its place in a list that may have to grow; tell whether that changed anything."""
    grown = number >= len(values)
    values.extend([empty] * (number + 1 - len(values)))
    changed = grown or values[number] != value
    values[number] = value
    return changed
