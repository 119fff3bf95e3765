# SPDX-License-Identifier: BSD-3-Clause
"""The errors of this package; each text says what was found and what would be right."""


class ControlError(Exception):
    """Base class of this package's errors."""


class ControllerError(ControlError):
    """A controller cannot be made from its parameters and this hardware."""


class HardwareError(ControlError):
    """A description defines no hardware that can be controlled."""


class Refused(ControlError):
    """A request to the controller manager is not carried out; nothing has changed."""
