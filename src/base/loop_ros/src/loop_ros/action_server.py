# SPDX-License-Identifier: BSD-3-Clause
"""The server's side of actionlib for a loop that must not wait.

On the wire it behaves as ``actionlib.ActionServer``; inside it works differently: goals and cancel requests come in
through queues and are handled when the loop calls :meth:`ActionServer.spin`; status, feedback and results go out
through publishers that never wait. One thread; time is an argument. Without rospy.
"""
from __future__ import annotations

import io
import itertools
from collections.abc import Callable
from typing import Any

import genpy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from loop_ros.protocol import Topics
from sim_time.stamps import stamp

#: Period of the status while nothing changes, and how long a finished goal stays in it [s].
STATUS_PERIOD_S = 0.2
REMEMBERED_S = 5.0
#: Unread goals and cancel requests that are kept.
QUEUE_DEPTH = 50

_ENDED = (GoalStatus.REJECTED, GoalStatus.RECALLED, GoalStatus.PREEMPTED, GoalStatus.ABORTED, GoalStatus.SUCCEEDED)

# For each step: {state in which it is allowed: the next state}.
_STEPS = {
    "accept": {GoalStatus.PENDING: GoalStatus.ACTIVE, GoalStatus.RECALLING: GoalStatus.PREEMPTING},
    "reject": {GoalStatus.PENDING: GoalStatus.REJECTED, GoalStatus.RECALLING: GoalStatus.REJECTED},
    "cancel": {GoalStatus.PENDING: GoalStatus.RECALLED, GoalStatus.RECALLING: GoalStatus.RECALLED,
               GoalStatus.ACTIVE: GoalStatus.PREEMPTED, GoalStatus.PREEMPTING: GoalStatus.PREEMPTED},
    "abort": {GoalStatus.ACTIVE: GoalStatus.ABORTED, GoalStatus.PREEMPTING: GoalStatus.ABORTED},
    "succeed": {GoalStatus.ACTIVE: GoalStatus.SUCCEEDED, GoalStatus.PREEMPTING: GoalStatus.SUCCEEDED},
    "request cancel of": {GoalStatus.PENDING: GoalStatus.RECALLING, GoalStatus.ACTIVE: GoalStatus.PREEMPTING},
}
_STATE_NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper() and isinstance(value, int)}

# Goals and cancel requests come on two topics, yet "cancel all, then do this" must not cancel the new goal: messages
# are numbered as they come in.
_arrivals = itertools.count()


class WrongState(Exception):
    """The state of the goal does not allow this step."""


class GoalHandle:
    """One goal: ``goal`` (the message's goal part, None for a goal that was cancelled before it came), ``status``."""

    def __init__(self, server: ActionServer, goal: Any, goal_id: GoalID, state: int) -> None:
        self.goal = goal
        self.status = GoalStatus(goal_id=goal_id, status=state)
        self.ended_s: float | None = None
        self._server = server

    @property
    def state(self) -> int:
        """One of the constants of ``actionlib_msgs/GoalStatus``."""
        return self.status.status

    def accept(self, text: str = "") -> None:
        """Start work on the goal."""
        self._step("accept", text)

    def reject(self, result: Any = None, text: str = "") -> None:
        """Refuse the goal. ``result``: message, default an empty one; the same below."""
        self._step("reject", text, result)

    def cancel(self, result: Any = None, text: str = "") -> None:
        """End the goal early: a client cancelled it, or a new goal replaces it."""
        self._step("cancel", text, result)

    def abort(self, result: Any = None, text: str = "") -> None:
        """End the goal: the work has failed."""
        self._step("abort", text, result)

    def succeed(self, result: Any = None, text: str = "") -> None:
        """End the goal: the work is done."""
        self._step("succeed", text, result)

    def publish_feedback(self, feedback: Any) -> None:
        """Publish the progress of the goal."""
        self._server._publish_feedback(self.status, feedback)

    def _may(self, step: str) -> bool:
        return self.state in _STEPS[step]

    def _step(self, step: str, text: str, result: Any = None) -> None:
        if not self._may(step):
            raise WrongState("cannot %s a goal that is %s" % (step, _STATE_NAMES[self.state]))
        self.status.status = _STEPS[step][self.state]
        self.status.text = text
        if self.state in _ENDED:
            self._server._publish_result(self, result)
        self._server._publish_status()


class ActionServer:
    """Serves one action. Every method belongs to the loop's thread."""

    def __init__(self, topics: Topics, name: str, action_class: Callable[[], Any],
                 on_goal: Callable[[GoalHandle], object], on_cancel: Callable[[GoalHandle], object]) -> None:
        """Open the five topics below ``name``.

        ``topics`` makes them: a ``loop_ros.protocol.Topics``. ``action_class``: e.g. ``FollowJointTrajectoryAction``.
        ``on_goal(handle)`` must accept or reject, at once or later; ``on_cancel(handle)`` should end the goal soon.
        """
        action = action_class()
        self._result_class = type(action.action_result)
        self._feedback_class = type(action.action_feedback)
        self._on_goal = on_goal
        self._on_cancel = on_cancel
        self._goals = topics.subscription(name + "/goal", _numbered(type(action.action_goal)), QUEUE_DEPTH)
        self._cancels = topics.subscription(name + "/cancel", _numbered(GoalID), QUEUE_DEPTH)
        self._status = topics.publisher(name + "/status", GoalStatusArray, latch=True)
        self._feedback = topics.publisher(name + "/feedback", self._feedback_class)
        self._result = topics.publisher(name + "/result", self._result_class)
        self._handles: list[GoalHandle] = []
        self._last_cancel = genpy.Time()
        self._time_s = 0.0
        self._next_status_s: float | None = None
        self._count = 0

    def spin(self, time_s: float) -> None:
        """Handle new goals and cancel requests, and publish the status when it is due. ``time_s``: now, control time
        [s]."""
        if time_s < self._time_s:
            self._time_went_back()
        self._time_s = time_s
        messages = self._goals.drain()
        cancels = self._cancels.drain()
        if cancels:
            messages = sorted(messages + cancels, key=lambda message: getattr(message, "arrival", 0))
        for message in messages:
            if isinstance(message, GoalID):
                self._cancels.guarded(self._take_cancel, message)
            else:
                self._goals.guarded(self._take_goal, message)
        if self._next_status_s is None or time_s >= self._next_status_s:
            self._publish_status()

    @property
    def feedback_is_heard(self) -> bool:
        """Whether the feedback topic has subscribers."""
        return self._feedback.has_listeners

    # -- inside -------------------------------------------------------------------------------------------------

    def _take_goal(self, message: Any) -> None:
        goal_id = message.goal_id
        _require_answerable(goal_id)
        for handle in self._handles:
            if handle.status.goal_id.id == goal_id.id:
                # The goal was sent twice, or cancelled before it arrived.
                if handle.state == GoalStatus.RECALLING:
                    handle.cancel()
                return
        now = self._now()
        if not goal_id.id:
            self._count += 1
            goal_id.id = "%s-%d-%d.%09d" % (self._result_class._type, self._count, now.secs, now.nsecs)
        stamp = goal_id.stamp
        if not stamp:
            goal_id.stamp = now
        handle = GoalHandle(self, message.goal, goal_id, GoalStatus.PENDING)
        self._handles.append(handle)
        if stamp and stamp <= self._last_cancel:
            handle.cancel(text="a request to cancel all goals up to a later time came before this goal")
        else:
            self._call_owner(handle, self._on_goal)

    def _call_owner(self, handle: GoalHandle, callback: Callable[[Any], Any]) -> None:
        """Call the owner's ``callback`` with a goal. If it raises, the goal is aborted, so that no client waits for
        it."""
        try:
            callback(handle)
        except Exception as error:
            text = "the server failed with %s: %s" % (type(error).__name__, error)
            if handle._may("reject"):
                handle.reject(text=text)
            elif handle._may("abort"):
                handle.abort(text=text)
            raise

    def _take_cancel(self, message: Any) -> None:
        _require_answerable(message)
        everything = not message.id and not message.stamp
        known = False
        for handle in list(self._handles):
            goal_id = handle.status.goal_id
            meant = bool(message.id) and goal_id.id == message.id
            known = known or meant
            if not (meant or everything or (message.stamp and goal_id.stamp <= message.stamp)):
                continue
            if handle._may("request cancel of"):
                handle._step("request cancel of", "")
                self._call_owner(handle, self._on_cancel)
        if message.id and not known:
            # The cancel request arrived before its goal; the goal will not start.
            early = GoalHandle(self, None, GoalID(message.stamp, message.id), GoalStatus.RECALLING)
            early.ended_s = self._time_s
            self._handles.append(early)
        self._last_cancel = max(self._last_cancel, message.stamp)

    def _publish_result(self, handle: GoalHandle, result: Any) -> None:
        handle.ended_s = self._time_s
        message = self._result_class(status=handle.status)
        message.header.stamp = self._now()
        if result is not None:
            message.result = result
        self._result.publish(message)

    def _publish_feedback(self, status: GoalStatus, feedback: Any) -> None:
        if self._feedback.has_listeners:
            message = self._feedback_class(status=status, feedback=feedback)
            message.header.stamp = self._now()
            self._feedback.publish(message)

    def _publish_status(self) -> None:
        forgotten_s = self._time_s - REMEMBERED_S
        self._handles = [handle for handle in self._handles if handle.ended_s is None or handle.ended_s > forgotten_s]
        message = GoalStatusArray(status_list=[handle.status for handle in self._handles])
        message.header.stamp = self._now()
        self._status.publish(message)
        self._next_status_s = self._time_s + STATUS_PERIOD_S

    def _time_went_back(self) -> None:
        self._next_status_s = None
        # After time was reset, old stamps would cancel new goals for a long while. Also, actionlib derives goal ids
        # from the time: a new goal may have the id of a finished one.
        self._last_cancel = genpy.Time()
        self._handles = [handle for handle in self._handles if handle.ended_s is None]

    def _now(self) -> genpy.Time:
        return stamp(self._time_s)


def _require_answerable(goal_id: GoalID) -> None:
    """Raise if the id cannot be serialized: genpy can read stamps that it cannot write, and then no status could be
    published."""
    goal_id.serialize(io.BytesIO())


def _numbered(msg_class: type) -> type:
    """``msg_class`` with a field ``arrival`` that is not on the wire: it counts the messages of all topics."""
    def deserialize(self: Any, data: bytes) -> Any:
        self.arrival = next(_arrivals)
        return msg_class.deserialize(self, data)

    return type(msg_class.__name__, (msg_class,), {"deserialize": deserialize, "arrival": 0})
