# SPDX-License-Identifier: BSD-3-Clause
"""The error that this package raises."""


class MoveItCommanderException(Exception):
    """A request to a commander failed; the text says what, with which value, and what would be correct."""
