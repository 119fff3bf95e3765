# SPDX-License-Identifier: BSD-3-Clause
"""What can go wrong; each text says what was found and what would be right."""


class ControlError(Exception):
    """Root of the errors of this package."""


class ControllerError(ControlError):
    """A controller cannot be made from its parameters and this hardware."""


class HardwareError(ControlError):
    """A description does not give a robot hardware that can be controlled."""


class Refused(ControlError):
    """A request to the controller manager is not carried out; nothing has changed."""
