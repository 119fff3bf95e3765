# SPDX-License-Identifier: BSD-3-Clause
"""Exceptions of the robot's core. Each text says what was found and what would have been right."""


class BaxterHardwareError(Exception):
    """Base class of this package's errors."""


class CommandRefused(BaxterHardwareError):
    """A command is refused as a whole; no part of it was applied."""


class ArmStands(CommandRefused):
    """The arm has collided, and takes no commands for a while."""
