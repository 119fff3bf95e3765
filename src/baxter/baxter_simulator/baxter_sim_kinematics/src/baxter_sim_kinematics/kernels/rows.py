# SPDX-License-Identifier: BSD-3-Clause
"""How much of a pose error counts."""
import enum


class Rows(enum.IntEnum):
    """Rows of the pose error that count: translation comes first, then rotation."""

    POSE = 6
    FREE_TURN = 5  # all but the turn about one axis of the tip
    POSITION = 3
