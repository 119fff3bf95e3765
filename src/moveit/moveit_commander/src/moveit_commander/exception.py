# SPDX-License-Identifier: BSD-3-Clause
"""The error that this package raises for what cannot be done."""


class MoveItCommanderException(Exception):
    """Something asked of a commander cannot be done; the text says what, with which value, and what would be right."""
