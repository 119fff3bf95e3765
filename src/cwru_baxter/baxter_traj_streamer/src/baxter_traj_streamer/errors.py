# SPDX-License-Identifier: BSD-3-Clause
"""Why a goal is refused: a reason, and where it was found."""


class GoalRefused(Exception):
    """A goal that will not be followed.

    ``reason``: one word (empty, joints, size, number, time, too_long, limit, velocity, start); ``point``, ``joint``,
    ``value``, ``limit``: where and what was found, None where that makes no sense.
    """

    def __init__(self, reason, text, point=None, joint=None, value=None, limit=None):
        super().__init__(text)
        self.reason, self.point, self.joint, self.value, self.limit = reason, point, joint, value, limit
