# SPDX-License-Identifier: BSD-3-Clause
"""Rows of the pose error that count."""
import enum


class Rows(enum.IntEnum):
    """Rows of the pose error that count: translation comes first, then rotation."""

    POSE = 6
    FREE_TURN = 5  # all but the turn about one axis of the tip
    POSITION = 3
