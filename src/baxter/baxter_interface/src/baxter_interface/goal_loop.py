# SPDX-License-Identifier: BSD-3-Clause
"""The loop of an action server: one goal at a time, a step of its work 20 times a second."""
from __future__ import annotations

import io
import threading
import time
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import rospy
from actionlib.action_server import ActionServer

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch, Ticker, is_unlimited
from baxter_model.readiness import lost, why_not_ready

from .goal_queue import GoalQueue
from .presence import Presence
from .resets import PUT_ELSEWHERE, Resets

if TYPE_CHECKING:
    from .robot_enable import RobotEnable

RATE_HZ = 20.0
# No goal ends sooner than this after it has come [s, wall]: actionlib's simple client loses a goal, and waits for ever,
# if the goal ends before its send_goal has returned.
SHORTEST_GOAL_S = 0.05
_LOOK_UP_S = 0.5


class GoalWork(NamedTuple):
    """The work of one goal.

    `step()` does the next step and returns whether the goal is reached; `stop()` is called when it ends early and the
    robot can still be commanded; `missed()` returns a text about the remaining error; `make_result()` makes the result
    message; `timeout_s` [s, ROS time], below 0 for none; `refusal` is the reason why the goal is refused, or "".
    """

    step: Callable[[], bool]
    stop: Callable[[], object]
    missed: Callable[[], str]
    make_result: Callable[[], Any]
    timeout_s: float
    refusal: str = ""


class GoalLoop:
    """Serves an action. Each goal ends exactly once; the newest goal preempts the one before.

    Parameters: `name` of the action and its class `action`; `robot`, a RobotEnable; `label`, for the log;
    `begin(handle)`, called in the loop's thread, makes the GoalWork for the goal of an actionlib handle.
    (actionlib's own SimpleActionServer refuses every goal for a while after a simulation was restarted.)
    """

    def __init__(self, name: str, action: type, robot: RobotEnable, label: str,
                 begin: Callable[[Any], GoalWork]) -> None:
        self._robot = robot
        self._label = label
        self._begin = begin
        self._goals = GoalQueue(lambda handle, text: handle.set_canceled(text=text))
        self._ending = False
        self._presence = Presence(rospy.resolve_name("robot/state"), robot.silence_s)
        self._resets, self._resets_before = Resets(), 0
        self._clock = RosClock(gives_up=lambda: self._is_unwanted() or bool(self._trouble()))
        self._thread = threading.Thread(target=self._run, name=label, daemon=True)
        self._server = ActionServer(name, action, self._goals.put, self._goals.cancel, auto_start=False)
        start(self._server)
        self._thread.start()

    def clean_shutdown(self, timeout_s: float = 2.0) -> None:
        """End the goal, if there is one, and wait for that, `timeout_s` [s, wall] at most."""
        self._ending = True
        self._goals.close()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while not self._ending and not rospy.is_shutdown():
            handle = self._goals.take(_LOOK_UP_S)
            if handle is None:
                continue
            begin_s = time.monotonic()
            handle.set_accepted()
            try:
                end, result, text = self._carry_out(handle)
            except Exception as error:
                # Every goal must end, whatever happens.
                rospy.logerr("%s: %s", self._label, traceback.format_exc())
                end, result, text = handle.set_aborted, None, "the action server failed: %s" % error
            time.sleep(max(0.0, begin_s + SHORTEST_GOAL_S - time.monotonic()))
            self._goals.done()
            end(result, text)

    def _carry_out(self, handle: Any):
        """Returns how the goal ends: the handle's method, the result, and a text."""
        self._resets_before = self._resets.count
        work = self._begin(handle)
        why = work.refusal or self._trouble()
        watch, ticker = Stopwatch(self._clock.now()), Ticker(self._clock, RATE_HZ)
        while not why:
            if self._is_unwanted():
                work.stop()
                return handle.set_canceled, work.make_result(), "preempted; %s" % work.missed()
            if work.step():
                return handle.set_succeeded, work.make_result(), ""
            elapsed_s = watch.elapsed_s(self._clock.now())
            if not is_unlimited(work.timeout_s) and elapsed_s >= work.timeout_s:
                work.stop()
                why = "not reached after %.1f s" % elapsed_s
            else:
                ticker.sleep()
                why = self._trouble()
                if self._ending:
                    work.stop()
            if why:
                why = "%s; %s" % (why, work.missed())
            if self._resets.count != self._resets_before:
                self._stop_after_reset(work)
        rospy.logerr("%s: goal aborted: %s", self._label, why)
        return handle.set_aborted, work.make_result(), why

    def _stop_after_reset(self, work) -> None:
        """Stop a motion whose command was sent before the reset and received after it.

        The stop commands the measured position, which must be one from after the reset; so time has to pass.
        """
        clock = RosClock(gives_up=lambda: self._is_unwanted() or self._ending or rospy.is_shutdown())
        clock.sleep(1.0 / RATE_HZ)
        if not self._is_unwanted() and not self._trouble(since_reset=True):
            work.stop()

    def _is_unwanted(self):
        return self._goals.is_cancelled or self._goals.has_next

    def _trouble(self, since_reset: bool = False):
        """Why nothing can be moved now, or "". since_reset: ignore a reset in the meantime."""
        if self._ending or rospy.is_shutdown():
            return "the action server was shut down"
        if self._presence.is_gone():
            return lost("its state")
        if not since_reset and self._resets.count != self._resets_before:
            return PUT_ELSEWHERE
        return why_not_ready(self._robot.state())


def can_be_answered(goal_id: Any) -> bool:
    """Whether an actionlib_msgs/GoalID can be sent back; logs the reason if not.

    genpy reads stamps that it cannot write. With such an id in the status list, no status could be sent, and a partial
    message would remain for the next one.
    """
    try:
        goal_id.serialize(io.BytesIO())
    except Exception as error:  # whatever the generated code raises
        rospy.logwarn("a goal or cancel request is dropped, because its id cannot be sent back: %s", error)
        return False
    return True


def start(server: Any) -> None:
    """Start an actionlib.ActionServer whose status goes on when simulated time goes back, as at a restart.

    actionlib's own timer would end then. Errors of the timer while Ctrl-C closes the topic are ignored. Goals and
    cancel requests with an id that cannot be sent back are dropped.
    """
    take_goal, take_cancel = server.internal_goal_callback, server.internal_cancel_callback

    def on_goal(goal: Any) -> None:
        # A server that receives its goals as bytes checks the id itself.
        if not hasattr(goal, "goal_id") or can_be_answered(goal.goal_id):
            take_goal(goal)

    def on_cancel(goal_id: Any) -> None:
        if can_be_answered(goal_id):
            take_cancel(goal_id)

    # Done before the server subscribes to its topics.
    server.internal_goal_callback, server.internal_cancel_callback = on_goal, on_cancel

    def publish_status(event) -> None:
        try:
            server.publish_status_async(event)
        except rospy.ROSException:
            # rospy closes topics a little before is_shutdown() is true.
            if not rospy.core.is_shutdown_requested():
                raise

    server.start()
    if server.status_frequency > 0.0:
        server.status_timer.shutdown()
        server.status_timer = rospy.Timer(rospy.Duration(1.0 / server.status_frequency), publish_status, reset=True)
