# SPDX-License-Identifier: BSD-3-Clause
"""Sentences for all programs: why the robot does not move, and the command that helps."""

ENABLE = "rosrun baxter_tools enable_robot.py -e"
RESET = "rosrun baxter_tools enable_robot.py -r"
NOT_ENABLED = "the robot is not enabled; enable it: " + ENABLE
STOPPED = "the robot is stopped; release its stop button if it is pressed, then reset it: %s, and enable it: -e" % RESET

# How many states a subscriber keeps for a thread that does not get to run: a robot that was disabled for a moment has
# stopped its arms, and whoever moves them must hear of it.
STATES_KEPT = 100


def why_not_ready(state):
    """Return why a robot ignores motion commands, "" if it takes them.

    ``state``: anything with ``stopped`` and ``enabled``, such as a baxter_core_msgs/AssemblyState.
    """
    if state.stopped:
        return STOPPED
    return "" if state.enabled else NOT_ENABLED


def lost(topic):
    """Return the sentence that the robot is gone, known by the silence of ``topic``."""
    return "the robot was lost: nobody publishes %s any more" % topic
