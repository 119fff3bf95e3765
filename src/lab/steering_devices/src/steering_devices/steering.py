# SPDX-License-Identifier: BSD-3-Clause
"""The meaning of hands on a keyboard or a gamepad: a twist while something is held, the gripper, marks. Free of ROS."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: Rows of a twist.
ROWS = ("x", "y", "z", "roll", "pitch", "yaw")
MARKS = ("success", "failure", "again")
GRIPPER = ("open", "close")
# Of a layout's "hold". ROS's parameters have no null.
_NO_BUTTON = "none"
# Beside a key's repetition by the terminal; after that it counts as released [s].
_HELD_S = 0.15
_SPEEDS = (0.1, 0.2, 0.35, 0.5, 0.75, 1.0)

#: The greatest number that a parameter of a device may be.
MOST = 100.0

#: Key: (what it does on screen, row, sign).
MOTIONS = {"w": ("forward", 0, 1.0), "s": ("back", 0, -1.0), "a": ("left", 1, 1.0), "d": ("right", 1, -1.0),
           "r": ("up", 2, 1.0), "f": ("down", 2, -1.0), "u": ("roll +", 3, 1.0), "o": ("roll -", 3, -1.0),
           "k": ("pitch +", 4, 1.0), "i": ("pitch -", 4, -1.0), "j": ("yaw +", 5, 1.0), "l": ("yaw -", 5, -1.0)}
OTHER_KEYS = {"g": "open or close the gripper", "h": "the other hand", "t": "axes of the base or of the tool",
              "+": "faster", "-": "slower", " ": "stop", "1": "mark: success", "2": "mark: failure", "3": "mark: again",
              "x": "end"}


class DeviceParameterError(ValueError):
    """A parameter of a device that cannot be used; the text names it, its value and what would be right."""


class LayoutError(DeviceParameterError):
    """A gamepad's layout that cannot be used, with the reason."""


@dataclass
class Steering:
    """The motion that is wanted now: twist (6,), -1 to 1; in the tool's axes or the base's; of which hand. gripper,
    mark: "" or what was pressed since the last look."""

    twist: np.ndarray = field(default_factory=lambda: np.zeros(6))
    hand: int = 0
    in_tool: bool = False
    gripper: str = ""
    mark: str = ""
    ends: bool = False


class KeyboardSteering:
    """Keys of a terminal, which tells presses and repetitions but no releases: a key counts as held for a moment after
    each of them."""

    def __init__(self, hands: int = 1) -> None:
        self.hands, self.speed = hands, 1
        self.now = Steering()
        self._until = np.full(6, -np.inf)
        self._sign = np.zeros(6)
        self._closed = [False] * hands

    def press(self, key: str, now: float) -> bool:
        """Take a key at ``now`` [s]; whether it means something."""
        state = self.now
        if key in MOTIONS:
            _, row, sign = MOTIONS[key]
            self._until[row], self._sign[row] = now + _HELD_S, sign
        elif key == "g":
            closed = self._closed[state.hand] = not self._closed[state.hand]
            state.gripper = GRIPPER[closed]
        elif key == "h":
            self._until[:] = -np.inf
            state.hand = (state.hand + 1) % self.hands
        elif key == "t":
            self._until[:] = -np.inf
            state.in_tool = not state.in_tool
        elif key in ("+", "-", "="):
            self.speed = min(max(self.speed + (-1 if key == "-" else 1), 0), len(_SPEEDS) - 1)
        elif key == " ":
            self._until[:] = -np.inf
        elif key in ("1", "2", "3"):
            state.mark = MARKS[int(key) - 1]
        elif key == "x":
            self._until[:] = -np.inf
            state.ends = True
        else:
            return False
        return True

    def take(self, now: float) -> Steering:
        """Return the Steering at ``now`` [s]."""
        taken = self.now
        taken.twist = np.where(now < self._until, self._sign, 0.0) * _SPEEDS[self.speed]
        self.now = Steering(hand=taken.hand, in_tool=taken.in_tool)
        return taken

    @property
    def speed_share(self) -> float:
        """Share of the full speed."""
        return _SPEEDS[self.speed]


class Gamepad:
    """Sticks and buttons by a layout: {motions: {x: {axis: 1, scale: 1.0} or {buttons: [plus, minus]}, ...},
    hold: button, open, close, hand, tool, success, failure, again: buttons, dead_zone: of the axes}. Nothing moves
    unless ``hold`` is held; where it is "none", as of a cap that returns to its middle, what is let go is at rest."""

    def __init__(self, layout: object, hands: int = 1) -> None:
        """Raises LayoutError."""
        self.hands = hands
        self._motions, self._buttons = {}, {}
        if not isinstance(layout, dict) or not isinstance(layout.get("motions"), dict) or "hold" not in layout:
            raise LayoutError("a gamepad's layout needs motions and hold, got %r" % (layout,))
        for row, source in layout["motions"].items():
            if row not in ROWS:
                raise LayoutError("the layout moves '%s'; expected some of %s" % (row, ", ".join(ROWS)))
            self._motions[ROWS.index(row)] = _source(row, source)
        zone = layout.get("dead_zone", 0.0)
        if isinstance(zone, bool) or not isinstance(zone, int | float) or not 0.0 <= zone < 1.0:
            raise LayoutError("dead_zone is %r; expected a number from 0, less than 1" % (zone,))
        self._dead_zone = zone
        for name in ("hold", "hand", "tool", *GRIPPER, *MARKS):
            if name in layout and not (name == "hold" and layout[name] == _NO_BUTTON):
                self._buttons[name] = _index("button of " + name, layout[name])
        self._before: dict[str, bool] = {}
        self._hand, self._in_tool = 0, False

    def take(self, axes: Any, buttons: Any) -> Steering:
        """Return the Steering of a Joy's ``axes`` and ``buttons``; those that it lacks count as released."""
        def button(index):
            return index < len(buttons) and bool(buttons[index])

        pressed = {name: button(index) for name, index in self._buttons.items()}
        new = {name for name, is_down in pressed.items() if is_down and not self._before.get(name, False)}
        self._before = pressed
        twist = np.zeros(6)
        for row, (axis, scale, plus, minus) in self._motions.items():
            if axis is not None and axis < len(axes):
                twist[row] = 0.0 if abs(axes[axis]) < self._dead_zone else scale * axes[axis]
            elif axis is None:
                twist[row] = scale * (float(button(plus)) - float(button(minus)))
        if "hand" in new:
            self._hand = (self._hand + 1) % self.hands
        self._in_tool ^= "tool" in new
        held = pressed.get("hold", True) and "hand" not in new and np.isfinite(twist).all()
        return Steering(np.clip(twist, -1.0, 1.0) if held else np.zeros(6), self._hand, self._in_tool,
                        next((name for name in GRIPPER if name in new), ""),
                        next((name for name in MARKS if name in new), ""))


def _source(row: str, source: Any) -> tuple:
    if isinstance(source, dict) and "axis" in source:
        return _index("axis of " + row, source["axis"]), _scale(row, source), 0, 0
    if isinstance(source, dict) and isinstance(source.get("buttons"), list) and len(source["buttons"]) == 2:
        plus, minus = (_index("button of " + row, one) for one in source["buttons"])
        return None, _scale(row, source), plus, minus
    raise LayoutError("%s is %r; expected {axis: number} or {buttons: [number, number]}" % (row, source))


def _scale(row: str, source: dict) -> float:
    try:
        return number("scale of " + row, source.get("scale", 1.0), -MOST, MOST)
    except DeviceParameterError as error:
        raise LayoutError(str(error)) from None


def number(what: str, value: Any, least: float, most: float = MOST) -> float:
    """Return ``value``, a number from ``least`` to ``most``. Raises DeviceParameterError, which says ``what`` it is."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise DeviceParameterError("%s is %r; expected a number from %g to %g" % (what, value, least, most))
    return float(value)


def _index(what: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise LayoutError("%s is %r; expected a number from 0" % (what, value))
    return value
