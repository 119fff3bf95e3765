# SPDX-License-Identifier: BSD-3-Clause
"""Events of a joystick: buttons that go down and up, sticks that move. Free of ROS.

Where the buttons and sticks are in a joy message differs between controllers; CONTROLLERS lists those we know, as their
Linux drivers number them. For sticks, left and up are positive.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Button:
    """Element `index` of the message's buttons."""

    index: int

    def read(self, axes: list[float], buttons: list[int]) -> bool:
        return bool(buttons[self.index])


@dataclass(frozen=True)
class AxisButton:
    """Down while element `index` of the message's axes is beyond `threshold`, on its side of 0."""

    index: int
    threshold: float

    def read(self, axes: list[float], buttons: list[int]) -> bool:
        value = axes[self.index]
        return value > self.threshold if self.threshold > 0.0 else value < self.threshold


@dataclass(frozen=True)
class Stick:
    """Element `index` of the message's axes."""

    index: int

    def read(self, axes: list[float], buttons: list[int]) -> float:
        return axes[self.index]


@dataclass(frozen=True)
class ControlLayout:
    """Controls by their names."""

    buttons: Mapping[str, Button | AxisButton]
    sticks: Mapping[str, Stick]


def _buttons(**indices: int) -> dict[str, Button]:
    return {name: Button(index) for name, index in indices.items()}


def _sticks(left_horizontal: int, left_vertical: int, right_horizontal: int, right_vertical: int) -> dict[str, Stick]:
    return {"leftStickHorz": Stick(left_horizontal), "leftStickVert": Stick(left_vertical),
            "rightStickHorz": Stick(right_horizontal), "rightStickVert": Stick(right_vertical)}


def _pad(horizontal: int, vertical: int) -> dict[str, AxisButton]:
    """A directional pad that reports as two axes."""
    return {"dPadUp": AxisButton(vertical, 0.5), "dPadDown": AxisButton(vertical, -0.5),
            "dPadLeft": AxisButton(horizontal, 0.5), "dPadRight": AxisButton(horizontal, -0.5)}


CONTROLLERS = {
    # Triggers are axes that rest at 1.0 and go to -1.0.
    "xbox": ControlLayout({**_buttons(btnDown=0, btnRight=1, btnLeft=2, btnUp=3, leftBumper=4, rightBumper=5,
                                      function1=6, function2=7),
                           "leftTrigger": AxisButton(2, -0.5), "rightTrigger": AxisButton(5, -0.5), **_pad(6, 7)},
                          _sticks(0, 1, 3, 4)),
    "logitech": ControlLayout({**_buttons(btnLeft=0, btnDown=1, btnRight=2, btnUp=3, leftBumper=4, rightBumper=5,
                                          leftTrigger=6, rightTrigger=7, function1=8, function2=9), **_pad(4, 5)},
                              _sticks(0, 1, 2, 3)),
    "ps3": ControlLayout(_buttons(function1=0, function2=3, dPadUp=4, dPadRight=5, dPadDown=6, dPadLeft=7,
                                  leftTrigger=8,
                                  rightTrigger=9, leftBumper=10, rightBumper=11, btnUp=12, btnRight=13, btnDown=14,
                                  btnLeft=15),
                         _sticks(0, 1, 2, 3)),
}


class ButtonEvents:
    """A button's state, and its changes since the last query."""

    def __init__(self) -> None:
        self.is_down = False
        self._went_down = self._went_up = False

    def update(self, is_down: bool) -> None:
        self._went_down |= is_down and not self.is_down
        self._went_up |= self.is_down and not is_down
        self.is_down = is_down

    def take_down(self) -> bool:
        """Tell whether it has gone down since the last call."""
        self._went_down, happened = False, self._went_down
        return happened

    def take_up(self) -> bool:
        """Tell whether it has gone up since the last call."""
        self._went_up, happened = False, self._went_up
        return happened


class StickEvents:
    """A stick's value = scale * raw + offset, 0 where the raw value is within `deadband`; and its moves."""

    def __init__(self, scale: float, offset: float, deadband: float) -> None:
        self.value = 0.0
        self._scale, self._offset, self._deadband = scale, offset, deadband
        self._last = 0.0

    def update(self, raw: float) -> None:
        self.value = 0.0 if abs(raw) < self._deadband else self._scale * raw + self._offset

    def take_move(self) -> float:
        """Return its signed movement since the last call."""
        self._last, before = self.value, self._last
        return self.value - before
