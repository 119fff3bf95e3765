# SPDX-License-Identifier: BSD-3-Clause
"""Sentences for all programs: why the robot does not move, and the command that helps."""

from __future__ import annotations

from typing import Any

ENABLE = "rosrun baxter_tools enable_robot.py -e"
RESET = "rosrun baxter_tools enable_robot.py -r"
UNFOLD = "rosrun baxter_tools tuck_arms.py -u"
NOT_ENABLED = "the robot is not enabled; enable it: " + ENABLE
STOPPED = "the robot is stopped; release its stop button if it is pressed, then reset it: %s, and enable it: -e" % RESET

# How many states a subscriber keeps for a thread that does not get to run: a robot that was disabled for a moment has
# stopped its arms, and whoever moves them must hear of it.
STATES_KEPT = 100


def why_not_ready(state: Any) -> str:
    """Return why a robot ignores motion commands, "" if it takes them.

    ``state``: anything with ``stopped`` and ``enabled``, such as a baxter_core_msgs/AssemblyState.
    """
    if state.stopped:
        return STOPPED
    return "" if state.enabled else NOT_ENABLED


def held_by_avoidance(parts) -> str:
    """Return the sentence that collision avoidance holds an arm; ``parts``: names of those that it is too near to."""
    return ("collision avoidance holds it: it is too near to %s. Move it away by another way; unfold folded arms: %s"
            % (", ".join(parts), UNFOLD))


def lost(topic: str) -> str:
    """Return the sentence that the robot is gone, known by the silence of ``topic``."""
    return "the robot was lost: nobody publishes %s any more" % topic
