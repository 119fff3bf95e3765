# SPDX-License-Identifier: BSD-3-Clause
"""Why there is no path."""
from motion_planning.errors import PlanningError


class NoPath(PlanningError):
    """No path was found. The text says why; ``late``: time was over, ``stopped``: the caller asked to end."""

    def __init__(self, reason, late=False, stopped=False):
        super().__init__(reason)
        self.late, self.stopped = late, stopped
