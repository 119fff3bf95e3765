# SPDX-License-Identifier: BSD-3-Clause
"""Invariants of a lab, whatever messages it gets. No ROS needed: messages are objects with ``__slots__``.

Each check returns a list of texts, one per fault.
"""
import math
from dataclasses import dataclass

# Slack of a joint's limit [rad]: a hard push against the stop of a joint that a contact holds.
LIMIT_SLACK = 0.02
# Message types in which infinity means "no echo" (as sensor_msgs/LaserScan defines it); NaN is wrong there, too.
INFINITE_BY_DEFINITION = ("sensor_msgs/LaserScan", "sensor_msgs/Range")


def numbers(message, path=""):
    """(path, float) of all floating-point numbers in a message, nested ones and arrays included."""
    if isinstance(message, float):
        yield path, message
    elif isinstance(message, list | tuple):
        for k, one in enumerate(message):
            if not isinstance(one, int | str):
                yield from numbers(one, "%s[%d]" % (path, k))
    elif hasattr(message, "__slots__") and not isinstance(message, int | str | bytes):
        for name in message.__slots__:
            yield from numbers(getattr(message, name), "%s.%s" % (path, name) if path else name)


def not_finite(topic, message_type, message):
    """NaN is a fault everywhere; infinity is one unless the type defines it."""
    allows_infinity = message_type in INFINITE_BY_DEFINITION
    found = [(path, value) for path, value in numbers(message)
             if math.isnan(value) or (math.isinf(value) and not allows_infinity)]
    return ["%s: %s is %r" % (topic, path, value) for path, value in found[:3]]


class JointLimits:
    """Positions stay between the limits of the robot's description."""

    def __init__(self, limits, slack=LIMIT_SLACK):
        """limits: {joint: (lower, upper)} [rad or m]; other joints are not checked."""
        self._limits, self._slack = limits, slack

    def check(self, names, positions):
        found = []
        for name, position in zip(names, positions, strict=True):
            lower, upper = self._limits.get(name, (-math.inf, math.inf))
            if not lower - self._slack <= position <= upper + self._slack:
                found.append("%s is at %.4f, its limits are %.4f and %.4f" % (name, position, lower, upper))
        return found


class Stamps:
    """Time stamps of a topic increase, except after an announced reset of the time."""

    def __init__(self):
        self._last, self._announced, self._seen = {}, 0, {}

    def announce_reset(self):
        """Announce a reset: from now on, each topic's time may go back once."""
        self._announced += 1

    def settle(self):
        """End of all announced resets: from now on, a topic's time must not go back."""
        self._seen = dict.fromkeys(self._last, self._announced)

    def check(self, topic, stamp):
        """Check the next stamp [s] of a topic."""
        last = self._last.get(topic)
        self._last[topic] = stamp
        if last is not None and stamp < last:
            self._seen[topic] = self._seen.get(topic, 0) + 1
            if self._seen[topic] <= self._announced:
                return []
            self._seen[topic] = self._announced
            return ["%s went from %.3f s back to %.3f s, and no reset was announced" % (topic, last, stamp)]
        return []


class Still:
    """Joints must not move while the check is armed."""

    def __init__(self, tolerance):
        """tolerance: greatest distance that a joint may move [rad]."""
        self._tolerance, self._reference = tolerance, None
        self.farthest = 0.0

    def arm(self, positions):
        """positions: {joint: position to keep}; other joints may move."""
        self._reference = dict(positions)

    def disarm(self):
        self._reference = None

    def check(self, names, positions):
        reference = self._reference  # another thread can disarm at any time
        if reference is None:
            return []
        found = []
        for name, position in zip(names, positions, strict=True):
            moved = abs(position - reference.get(name, position))
            self.farthest = max(self.farthest, moved)
            if not moved <= self._tolerance:
                found.append("%s moved by %.5f rad, although no message that was sent may move it" % (name, moved))
        return found


@dataclass(frozen=True)
class Usage:
    """Usage of a process: threads, open descriptors, private memory [bytes]."""

    threads: int
    descriptors: int
    memory: int


def grown(node, before, after, allowed):
    """Return a text for each figure of ``after`` that exceeds ``before`` by more than ``allowed`` (each a Usage)."""
    found = []
    for what in ("threads", "descriptors", "memory"):
        first, last, more = getattr(before, what), getattr(after, what), getattr(allowed, what)
        if last - first > more:
            found.append("%s: %s grew from %d to %d, %d more are allowed" % (node, what, first, last, more))
    return found


class Patience:
    """A deadline in CPU time instead of wall time: a process that gets no CPU must not fail.

    It ends when the answering process has used ``cpu_s`` [s] of CPU time since the request, or after ``wall_s`` [s] if
    it uses less: then the process is stuck.
    """

    def __init__(self, cpu_s, wall_s):
        self._cpu_s, self._wall_s = cpu_s, wall_s

    def check(self, what, cpu_s, wall_s):
        """cpu_s, wall_s: since the request [s]."""
        if cpu_s > self._cpu_s:
            return ["%s did not answer within %.0f s of its node's CPU time" % (what, self._cpu_s)]
        if wall_s > self._wall_s:
            return ["%s did not answer within %.0f s, in which its node used %.1f s of CPU time" % (
                what, self._wall_s, cpu_s)]
        return []


class EmergencyStop:
    """After a stop has arrived, the state shows it within ``ticks``, and the arms are at rest within ``rest_ticks``."""

    def __init__(self, ticks, rest_ticks, rest_speed):
        """rest_speed: of a joint that counts as at rest [rad/s]."""
        self._ticks, self._rest_ticks, self._rest_speed = ticks, rest_ticks, rest_speed

    def check(self, ticks_since, is_stopped, speeds):
        """ticks_since: from the tick that received the stop to the state; speeds: of the arms' joints [rad/s]."""
        found = []
        if ticks_since >= self._ticks and not is_stopped:
            found.append("%d ticks after the stop the state says that the robot is not stopped" % ticks_since)
        fastest = max(map(abs, speeds), default=0.0)
        if ticks_since >= self._rest_ticks and not fastest <= self._rest_speed:
            found.append("%d ticks after the stop a joint moves at %.4f rad/s" % (ticks_since, fastest))
        return found
