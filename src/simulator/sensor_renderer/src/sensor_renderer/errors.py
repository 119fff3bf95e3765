# SPDX-License-Identifier: BSD-3-Clause
"""The errors of this package."""


class RenderingError(Exception):
    """No renderer is available."""


class SensorError(Exception):
    """A camera is described in a way that cannot be used; the text says what was found and what would be right."""
