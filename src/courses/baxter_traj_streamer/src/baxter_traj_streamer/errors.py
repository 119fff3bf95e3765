# SPDX-License-Identifier: BSD-3-Clause
"""Errors: why a goal is refused, and where the fault is."""


class GoalRefused(Exception):
    """The goal is refused.

    ``reason``: one word (empty, joints, size, number, time, too_long, limit, velocity, start); ``point``, ``joint``,
    ``value``, ``limit``: place and value of the fault, None where not applicable.
    """

    def __init__(self, reason, text, point=None, joint=None, value=None, limit=None):
        super().__init__(text)
        self.reason, self.point, self.joint, self.value, self.limit = reason, point, joint, value, limit
