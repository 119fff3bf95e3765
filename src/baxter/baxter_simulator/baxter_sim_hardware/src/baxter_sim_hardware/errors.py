# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of the robot's core. Each text says what was found and what would have been right."""


class HardwareError(Exception):
    """Root of everything this package raises on purpose."""


class CommandRefused(HardwareError):
    """A command that cannot be obeyed as a whole; nothing of it was applied."""
