# SPDX-License-Identifier: BSD-3-Clause
"""Errors: why a goal is refused, and where the fault is."""

from __future__ import annotations


class GoalRefused(Exception):
    """The goal is refused.

    ``reason``: one word (empty, joints, size, number, time, too_long, limit, velocity, start); ``point``, ``joint``,
    ``value``, ``limit``: place and value of the fault, None where not applicable.
    """

    def __init__(self, reason: str, text: str, point: int | None = None, joint: str | None = None,
                 value: float | None = None, limit: float | None = None) -> None:
        super().__init__(text)
        self.reason, self.point, self.joint, self.value, self.limit = reason, point, joint, value, limit
