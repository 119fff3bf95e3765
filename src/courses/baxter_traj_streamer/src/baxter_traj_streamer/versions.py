# SPDX-License-Identifier: BSD-3-Clause
"""The two versions of the action ``traj`` that programs use.

The notes' version has a ``traj_id``. Case Western moved the action to another package in November 2015 and left
``traj_id`` out; the book's ``baxter_trajectory_streamer/traj`` is the same on the wire. Only its clients have that
package, so its messages are made from ours when the server or a client needs them.
"""
from __future__ import annotations

from typing import Any, NamedTuple

import genpy.dynamic

from .msg import trajAction  # pyright: ignore[reportMissingImports]  (generated)

NOTES, CURRENT = "baxter_traj_streamer/traj", "cwru_action/traj"
_ID_LINE = "int32 traj_id\n"


class Version(NamedTuple):
    """One version: its name and its message classes.

    has_id: whether goal and result have a ``traj_id``.
    """

    name: str
    action: type
    action_goal: type
    goal: type
    result: type
    feedback: type
    has_id: bool

    @property
    def md5sum(self) -> str:
        """MD5 sum of the goal, by which server and clients check that they use the same version."""
        return self.action_goal._md5sum

    def make_goal(self, trajectory: Any, traj_id: int) -> Any:
        return self.goal(trajectory=trajectory, **self._with_id(traj_id))

    def make_result(self, return_val: int, goal: Any) -> Any:
        """``goal``: the message that the result answers."""
        return self.result(return_val=return_val, **self._with_id(getattr(goal, "traj_id", None)))

    def _with_id(self, traj_id: int | None):
        return {"traj_id": traj_id} if self.has_id else {}


def version(name: str) -> Version:
    """The Version of this name. Raises ValueError for an unknown one."""
    if name not in VERSIONS:
        raise ValueError("action '%s' is not known; choices are %s" % (name, ", ".join(VERSIONS)))
    return VERSIONS[name]


def of_goal(md5sum: str) -> Version | None:
    """The Version whose goals have this MD5 sum, or None."""
    return next((each for each in VERSIONS.values() if each.md5sum == md5sum), None)


def _version(name: str, action: type) -> Version:
    goal, result, feedback = action().action_goal, action().action_result, action().action_feedback
    return Version(name, action, type(goal), type(goal.goal), type(result.result), type(feedback.feedback),
                   "traj_id" in goal.goal.__slots__)


def _without_id() -> type:
    text = trajAction._full_text.replace(_ID_LINE, "").replace(NOTES, CURRENT)
    return genpy.dynamic.generate_dynamic(CURRENT + "Action", text)[CURRENT + "Action"]


VERSIONS = {NOTES: _version(NOTES, trajAction), CURRENT: _version(CURRENT, _without_id())}
