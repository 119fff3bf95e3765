# SPDX-License-Identifier: BSD-3-Clause
"""One goal after the other for an action server whose work is a step, 20 times a second."""
import threading
import time

import rospy

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch, Ticker, is_unlimited

from .presence import Presence

RATE_HZ = 20.0
# No goal ends sooner than this after it has come [s, wall]: actionlib's simple client loses track of a goal, and waits
# for ever, when the end comes before its send_goal has returned.
SHORTEST_GOAL_S = 0.05


class GoalLoop:
    """Runs the goals of an actionlib.SimpleActionServer, and gives each exactly one end.

    Parameters: `server`; `robot`, a RobotEnable; `name`, for the log.
    """

    def __init__(self, server, robot, name):
        self._server = server
        self._robot = robot
        self._name = name
        self._ending = False
        self._begin_s = 0.0
        self._idle = threading.Event()
        self._idle.set()
        self._presence = Presence(rospy.resolve_name("robot/state"), robot.silence_s)
        self._clock = RosClock(gives_up=lambda: bool(self._trouble()) or self._server.is_preempt_requested())

    def end(self, timeout_s=2.0):
        """End the goal, if there is one, and wait for that, `timeout_s` [s, wall] at most."""
        self._ending = True
        self._idle.wait(timeout_s)

    def run(self, step, timeout_s, make_result, refusal, stop, missed):
        """Carry out one goal, in the server's execute callback.

        Parameters: `step()` does what is to be done now and tells whether the goal is reached; `timeout_s` [s, ROS
        time], below 0 for none; `make_result()` makes the result message; `refusal` says why the goal is not begun,
        "" if it is; `stop()` is called when it ends early, with the robot enabled; `missed()` says how far it came.
        """
        self._idle.clear()
        self._begin_s = time.monotonic()
        try:
            self._run(step, timeout_s, make_result, refusal, stop, missed)
        finally:
            self._idle.set()

    def _run(self, step, timeout_s, make_result, refusal, stop, missed):
        why = refusal or self._trouble()
        watch, ticker = Stopwatch(self._clock.now()), Ticker(self._clock, RATE_HZ)
        while not why:
            if self._server.is_preempt_requested():
                stop()
                self._server.set_preempted(make_result(), "preempted; %s" % missed())
                return
            if step():
                self._wait_for_client()
                self._server.set_succeeded(make_result())
                return
            elapsed_s = watch.elapsed_s(self._clock.now())
            if not is_unlimited(timeout_s) and elapsed_s >= timeout_s:
                stop()
                why = "not reached after %.1f s" % elapsed_s
            else:
                ticker.sleep()
                why = self._trouble()
                if self._ending:
                    stop()
            if why:
                why = "%s; %s" % (why, missed())
        rospy.logerr("%s: goal aborted: %s", self._name, why)
        self._wait_for_client()
        self._server.set_aborted(make_result(), why)

    def _wait_for_client(self):
        time.sleep(max(0.0, self._begin_s + SHORTEST_GOAL_S - time.monotonic()))

    def _trouble(self):
        """Why nothing can be moved now, "" if it can."""
        state = self._robot.state()
        if self._ending or rospy.is_shutdown():
            return "the action server was shut down"
        if self._presence.is_gone():
            return "the robot was lost: nobody publishes its state any more"
        if state.stopped:
            return "the robot is stopped; reset and enable it: rosrun baxter_tools enable_robot.py -e"
        return "" if state.enabled else "the robot is not enabled: rosrun baxter_tools enable_robot.py -e"
