# SPDX-License-Identifier: BSD-3-Clause
"""A goal that is cancelled at once is not taken for lost.

A goal that a server's list of goals does not name is lost, says actionlib, unless the goal has not been answered yet. A
cancelled goal does not count as such, so a list that was on its way when the goal was sent ended it: `wait_for_result`
returned without a result.
"""
from __future__ import annotations

import functools
import time
from typing import Any

#: A goal that no list has named yet is not lost for so long after the first list [s]; a server sends five a second.
UNKNOWN_S = 5.0


def amend(action_client: Any) -> None:
    """Make the goals of actionlib.action_client wait for a list that names them, for UNKNOWN_S at most."""
    machine = action_client.CommStateMachine
    update = machine.update_status

    @functools.wraps(update)
    def update_status(self, status_array):
        if _may_end(self, status_array):
            update(self, status_array)

    machine.update_status = update_status


def _may_end(goal: Any, status_array: Any) -> bool:
    """Whether a goal (an action_client.CommStateMachine) that this list does not name is lost; True where it does."""
    notes, now = vars(goal), time.monotonic()
    begin = notes.setdefault("_first_list", now)
    if any(status.goal_id.id == goal.action_goal.goal_id.id for status in status_array.status_list):
        notes["_named"] = True
    return "_named" in notes or now - begin > UNKNOWN_S
