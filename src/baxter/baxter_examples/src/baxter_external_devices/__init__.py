# SPDX-License-Identifier: BSD-3-Clause
"""Keyboards and joysticks that programs for the robot are steered with."""
from . import joystick
from .getch import Keyboard, getch

__all__ = ["Keyboard", "getch", "joystick"]
