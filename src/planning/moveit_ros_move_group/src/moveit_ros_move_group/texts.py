# SPDX-License-Identifier: BSD-3-Clause
"""Result texts, as clients of MoveIt compare them."""
from __future__ import annotations

from moveit_msgs.msg import MoveItErrorCodes

# Field and class share names; only the constants are of interest.
_NAMES = {value: name for name, value in vars(MoveItErrorCodes).items() if isinstance(value, int) and name.isupper()}
# A sentence with names from a request could be as long as the request.
_LONGEST = 1000


def one_line(text: str) -> str:
    """Return ``text`` in one line, its end left out where it is too long for one."""
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else "%s ... (%d characters in all)" % (text[:_LONGEST], len(text))


def result_text(code: int, reason: str = "", *, empty: bool = False, plan_only: bool = False) -> str:
    """Return the text of an action's result; ``empty``: nothing had to be moved, or no plan was found.

    If MoveIt returns only a code, the ``reason`` is added to it.
    """
    codes = MoveItErrorCodes
    fixed = {
        codes.SUCCESS: "Requested path and goal constraints are already met." if empty else
            "Motion plan was computed succesfully." if plan_only else "Solution was found and executed.",
        codes.INVALID_GROUP_NAME: "Invalid group in motion plan request",
        codes.PLANNING_FAILED: "No motion plan found. No execution attempted." if empty else "",
        codes.INVALID_MOTION_PLAN: "No motion plan found. No execution attempted." if empty else
            "Motion plan was found but it seems to be invalid (possibly due to postprocessing). Not executing.",
        codes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE:
            "Solution found but the environment changed during execution and the path was aborted",
    }.get(code)
    reason = one_line(reason)
    text = fixed or _NAMES.get(code, "error code %d" % code)
    if not reason:
        return text
    return "%s %s" % (text, reason) if text.endswith(".") else "%s: %s" % (text, reason)
