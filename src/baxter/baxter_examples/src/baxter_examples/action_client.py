# SPDX-License-Identifier: BSD-3-Clause
"""Send goals to an action server and wait for its verdict."""
from __future__ import annotations

import errno
from typing import TYPE_CHECKING, Any

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from baxter_dataflow import wait_for
from baxter_interface import startup
from baxter_interface.programs import ProgramFailed

if TYPE_CHECKING:
    from genpy import Message

SERVER_TIMEOUT_S = 10.0
_STATES = {getattr(GoalStatus, name): name.lower() for name in (
    "PENDING", "ACTIVE", "PREEMPTED", "SUCCEEDED", "ABORTED", "REJECTED", "PREEMPTING", "RECALLING", "RECALLED",
    "LOST")}


class ActionClient:
    """A client of the action `name` (relative) of type `kind`.

    `hint` is the command that starts its server. Raises ProgramFailed if there is none.
    """

    def __init__(self, name: str, kind: type, hint: str) -> None:
        self._name = name
        self._client = actionlib.SimpleActionClient(name, kind)
        startup.wait_for_start([])
        # A duration below 0 makes it check once: its own wait logs nothing when simulated time stands still.
        look = self._client.action_client.wait_for_server
        if not wait_for(lambda: look(rospy.Duration(0, -1)), SERVER_TIMEOUT_S, raise_on_error=False, rate=20):
            raise ProgramFailed("there is no action server for %s: start it with: %s"
                                % (rospy.resolve_name(name), hint), errno.ETIMEDOUT)

    def send(self, goal: Message) -> None:
        """Send a goal without waiting."""
        self._client.send_goal(goal)

    def is_done(self) -> bool:
        """Tell whether the last goal has its verdict and its result."""
        # The goal's status, a topic of its own, may say that it succeeded before the result is there.
        return self._client.simple_state == actionlib.SimpleGoalState.DONE

    def wait(self, timeout_s: float) -> Any:
        """Wait for the last goal's verdict, `timeout_s` [ROS time] at most, and return its result.

        A goal without verdict by then is cancelled. Raises ProgramFailed unless it succeeded.
        """
        try:
            in_time = wait_for(self.is_done, timeout_s, raise_on_error=False, rate=50)
        except KeyboardInterrupt:
            self.cancel()
            raise
        if not in_time:
            self.cancel()
            raise ProgramFailed("%s: no verdict after %.1f s" % (self._name, timeout_s), errno.ETIMEDOUT)
        state, result = self._client.get_state(), self._client.get_result()
        if state != GoalStatus.SUCCEEDED:
            reason = getattr(result, "error_string", "") or self._client.get_goal_status_text() or "no reason given"
            raise ProgramFailed("%s: %s: %s" % (self._name, _STATES.get(state, state), reason))
        return result

    def cancel(self) -> None:
        """Cancel the last goal if it has no verdict yet."""
        if not self.is_done():
            self._client.cancel_goal()
