# SPDX-License-Identifier: BSD-3-Clause
"""What can go wrong here."""


class RenderingError(Exception):
    """There is nothing to draw with."""


class SensorError(Exception):
    """A camera is described in a way that cannot be used; the text says what was found and what would be right."""
