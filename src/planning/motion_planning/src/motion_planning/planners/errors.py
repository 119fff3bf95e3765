# SPDX-License-Identifier: BSD-3-Clause
"""Errors of planners."""
from __future__ import annotations

from motion_planning.errors import PlanningError


class NoPath(PlanningError):
    """No path was found. The text gives the reason; ``late``: the time limit was reached, ``stopped``: the caller
    stopped it, ``spent``: a search gave up after its number of samples."""

    def __init__(self, reason: str, late: bool = False, stopped: bool = False, spent: bool = False) -> None:
        super().__init__(reason)
        self.late, self.stopped, self.spent = late, stopped, spent
