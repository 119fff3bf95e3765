# SPDX-License-Identifier: BSD-3-Clause
"""The one error of this package."""


class UrdfError(ValueError):
    """A robot description that cannot be used: its text names source and line, what was found and what is right."""
