# SPDX-License-Identifier: BSD-3-Clause
"""Errors of this package."""


class SysidError(Exception):
    """A recording, a robot or a fit cannot be used; the text says why."""
