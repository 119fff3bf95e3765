# SPDX-License-Identifier: BSD-3-Clause
"""Makes rospy.init_node return only when simulated time runs.

Under /use_sim_time rospy's time is 0 until the first message on /clock and then jumps, possibly by minutes. If a
program waits for 2 s at that moment, as the vendor's SDK does, its wait ends before anything could arrive.
"""
from __future__ import annotations

import functools
import os
import re
import sys
import time
from collections.abc import Callable
from typing import Any

import master_calls
from command_line.waiting_line import WaitingLine
from master_calls import simulator_start

# Longest wait for /clock if nobody publishes it and no simulator is starting [s, wall].
NOBODY_S = 5.0
# Longest wait if it has a publisher: a stopped publisher sends nothing [s, wall].
SILENT_S = 30.0
# Longest wait while a simulator is starting [s, wall].
STARTING_S = 300.0
# /use_sim_time is set a moment after roslaunch has started the master [s, wall].
PARAMETER_S = 5.0
# A shorter wait prints nothing [s].
FIRST_NOTICE_S = 1.0
# Period of queries for the clock's publishers at the master [s].
LOOK_EVERY_S = 0.5
# ROS's own command-line tools do not wait: they show the present state, even without /clock.
_TOOLS = re.compile(r"(/usr)?/bin/[^/]+|/opt/ros/[^/]+/bin/[^/]+")


class ClockWait:
    """Decides how long init_node waits. Free of ROS; times are wall time [s].

    Parameters: `watch` is a StartWatch; `wants_the_world`: go on waiting while models are spawned. Attributes: `what`
    names the awaited thing; `complaint` is the error text after a failed wait.
    """

    def __init__(self, watch: simulator_start.StartWatch, wants_the_world: bool, begin_s: float) -> None:
        self.what = "the first message on /clock, since /use_sim_time is true"
        self.complaint = ""
        self.waited_s = 0.0
        self._watch = watch
        self._wants_the_world = wants_the_world
        self._begin_s = self._look_at_s = begin_s
        self._end_s = begin_s + NOBODY_S
        self._starting: list[str] = []

    def is_over(self, has_time: bool, is_published: Callable[[], bool], now_s: float) -> bool:
        """Whether init_node may return: `has_time`: a message has come; `is_published()`: there is a publisher."""
        self.waited_s = now_s - self._begin_s
        if has_time and not self._wants_the_world:
            return True
        if now_s >= self._look_at_s:
            try:
                self._look(now_s, has_time or is_published())
            except simulator_start.SimulatorDied as died:
                self.complaint = str(died)
                return True
            self._look_at_s = now_s + LOOK_EVERY_S
        if has_time and not self._starting:
            return True
        if now_s < self._end_s:
            return False
        if not has_time:
            self.complaint = ("/use_sim_time is true, but nothing has come on /clock for %.0f s: continuing with the "
                              "time at 0. Start the simulator, or without one: rosparam set use_sim_time false"
                              % self.waited_s)
        return True

    def _look(self, now_s, is_published):
        self._starting = self._watch.look()
        if self._starting:
            self.what = "the simulator, which is starting (%s)" % ", ".join(self._starting)
            self._end_s = min(now_s + NOBODY_S, self._begin_s + STARTING_S)
        elif is_published:
            self._end_s = max(self._end_s, self._begin_s + SILENT_S)


def amend(client: Any) -> None:
    """Replace init_node in the module rospy.client by the waiting version."""
    client.init_node = _waiting(client.init_node)


def _waiting(init_node):
    @functools.wraps(init_node)
    def init_node_and_wait(*args, **options):
        import rospy
        if rospy.core.is_initialized() or _is_tool(sys.argv):
            return init_node(*args, **options)
        is_early = not _master_answers()
        result = init_node(*args, **options)
        if is_early and rospy.rostime.is_wallclock() and not _option(init_node, "disable_rostime", args, options):
            _follow_late_parameter(rospy)
        if not rospy.rostime.is_wallclock():
            _wait(rospy)
        return result
    return init_node_and_wait


def _option(function, name, args, options):
    names = function.__code__.co_varnames[:function.__code__.co_argcount]
    return dict(zip(names, args, strict=False), **options).get(name, False)


def _is_tool(argv: list[str]) -> bool:
    return bool(argv and _TOOLS.fullmatch(os.path.realpath(argv[0])))


def _is_of_a_launch(argv: list[str]) -> bool:
    """Whether roslaunch has started this program, which then belongs to the same start as the simulator."""
    return any(word.startswith("__name:=") for word in argv)


def _master_answers() -> bool:
    import rosgraph

    try:
        master_calls.proxy(rosgraph.get_master_uri(), simulator_start.ANSWER_TIMEOUT_S).getPid("/first_clock")
    except master_calls.NO_ANSWER:
        return False
    return True


def _follow_late_parameter(rospy):
    """Give roslaunch time to set /use_sim_time; follow /clock if it does."""
    end_s = time.monotonic() + PARAMETER_S
    while time.monotonic() < end_s and not rospy.is_shutdown():
        if rospy.get_param("/use_sim_time", False):
            rospy.impl.simtime.init_simtime()
            return
        time.sleep(0.1)


def _wait(rospy):
    """Wait for the first message on /clock, and for a starting simulator."""
    import rosgraph

    topic = rospy.resolve_name(simulator_start.CLOCK)
    if topic != simulator_start.CLOCK or rospy.topics.get_topic_manager().has_publication(topic):
        return
    is_of_a_launch = _is_of_a_launch(sys.argv)
    # Nodes of a launch share its terminal, where the simulator itself reports its progress.
    line = None if is_of_a_launch else WaitingLine()
    wait = ClockWait(simulator_start.StartWatch(rosgraph.get_master_uri(), rospy.get_name()),
                     wants_the_world=not is_of_a_launch, begin_s=time.monotonic())
    ticked = rospy.rostime.get_rostime_cond()
    before = rospy.rostime._rostime_current
    try:
        while not rospy.is_shutdown():
            # A world that starts paused sends 0.
            has_time = rospy.get_time() > 0.0 or rospy.rostime._rostime_current is not before
            if wait.is_over(has_time, lambda: _is_published(rospy, topic), time.monotonic()):
                break
            if line and wait.waited_s >= FIRST_NOTICE_S:
                line.say(wait.what, wait.waited_s)
            if has_time:
                time.sleep(0.1)
            else:
                with ticked:
                    ticked.wait(0.05)
    finally:
        if line:
            line.end()
    if wait.complaint:
        rospy.logwarn("%s", wait.complaint)


def _is_published(rospy, topic):
    try:
        return topic in dict(rospy.get_published_topics())
    except master_calls.NO_ANSWER:
        return False
