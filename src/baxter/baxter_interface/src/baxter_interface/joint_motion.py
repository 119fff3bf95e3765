# SPDX-License-Identifier: BSD-3-Clause
"""A smooth move of some joints to a target, and the check of their arrival. Free of ROS.

Why not send the target and let the robot's own limits shape the move? Because programs expect a gentle move, and after
a step every joint starts at full speed and stops hard. Why not low-pass the command? Because a filter never quite
arrives, starts with a jump of speed, and has a time constant for one loop rate only. A minimum-jerk curve starts and
ends at rest, is the same at any loop rate, ends exactly on the target at a known time, and carries all joints along a
straight line in joint space. Only a call that ends before such a curve does is filtered, as by the vendor's SDK:
programs repeat it at a steady rate to move the arm, and a curve that begins from rest at each call would not move it.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from .settings import JOINT_ANGLE_TOLERANCE

# 80 % of the joint speed limits of the robot's model (1.5 and 4.0 rad/s), so that the arm keeps up with its command.
PEAK_SPEED_RAD_S = {"s0": 1.2, "s1": 1.2, "e0": 1.2, "e1": 1.2, "w0": 3.2, "w1": 3.2, "w2": 3.2}
# The joint acceleration limit that the robot's motion planning configuration uses for every joint [rad/s^2].
PEAK_ACCELERATION_RAD_S2 = 2.0

# Peaks of the first and second derivative of 10 u^3 - 15 u^4 + 6 u^5 on 0..1: at u = 1/2, and at u = 1/2 -+ sqrt(3)/6.
_PEAK_SLOPE = 15.0 / 8.0
_PEAK_CURVATURE = 10.0 / math.sqrt(3.0)

# An arm inside the tolerance may still be moving. It gets this long to come to rest [s], so that a program that then
# reads the angles, or freezes them with exit_control_mode, gets those of the target ...
SETTLE_TIME_S = 0.5
# ... below this speed it counts as resting [rad/s].
SETTLED_SPEED_RAD_S = 0.005
# A robot counts as disabled after it has reported so for this long [s]: another subscriber may get the state after a
# successful enable() first.
DISABLED_GRACE_S = 0.25
# The filter of the vendor's SDK: 100 commands a second through a low pass of first order at 0.2 Hz.
FILTER_PERIOD_S = 0.01
FILTER_TIME_S = 1.0 / (2.0 * math.pi * 0.2)
# An arm stands still that has not moved this far [rad] for so long [s], although it is farther than that from its goal.
# The other arm may still make room: that takes longer.
STILL_RAD, FAR_RAD = 0.02, 0.05
STILL_S, MAKING_ROOM_S = 0.75, 5.0


class SmoothPath:
    """Joint angles over time from `start` to `target` (dicts of joint name to rad, same names)."""

    def __init__(self, start: dict[str, float], target: dict[str, float]) -> None:
        self._start = {name: start[name] for name in target}
        self._target = dict(target)
        self.duration_s = max((_duration_s(name, target[name] - start[name]) for name in target), default=0.0)

    def angles(self, time_s: float) -> dict[str, float]:
        """Angles [rad] at `time_s` after the start; exactly the target from `duration_s` on."""
        if time_s >= self.duration_s:
            return dict(self._target)
        u = max(0.0, time_s) / self.duration_s
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        return {name: angle + share * (self._target[name] - angle) for name, angle in self._start.items()}


class FilteredPath:
    """Joint angles over time towards `target` through the vendor's filter; they never quite arrive.

    The first angles are one period of the filter ahead of `start`.
    """

    def __init__(self, start: dict[str, float], target: dict[str, float]) -> None:
        self._start, self._target = start, dict(target)

    def angles(self, time_s: float) -> dict[str, float]:
        """Angles [rad] at `time_s` after the start."""
        rest = math.exp(-(time_s + FILTER_PERIOD_S) / FILTER_TIME_S)
        return {name: angle + rest * (self._start[name] - angle) for name, angle in self._target.items()}


class Standstill:
    """Notices that an arm does not move towards its goal."""

    def __init__(self) -> None:
        self._since_s = None
        self._angles = {}

    def look(self, now_s: float, is_far: bool, angles: dict[str, float]) -> float:
        """How long the arm has stood still at `now_s` [s], less than STILL_S for one that has not.

        `is_far`: whether it is far from its goal; `angles`: the measured ones by joint name [rad].
        """
        moved = any(abs(angle - self._angles.get(name, math.inf)) > STILL_RAD for name, angle in angles.items())
        if self._since_s is None or not is_far or moved or now_s < self._since_s:
            self._since_s, self._angles = now_s, dict(angles)
        return now_s - self._since_s


class Hindrance(NamedTuple):
    """The reason why an arm does not move.

    text: "" if nothing is known; is_lasting: whether the arm will not move any further on its way.
    """

    text: str = ""
    is_lasting: bool = False


NO_HINDRANCE = Hindrance()


def is_far(angles: dict[str, float], goal: dict[str, float]) -> bool:
    """Whether a joint of `goal` is far from it; both by joint name [rad]."""
    return any(abs(angle - angles[name]) > FAR_RAD for name, angle in goal.items())


def _duration_s(name: str, distance_rad: float) -> float:
    """Shortest time [s] that keeps one joint's speed and acceleration under their peaks."""
    distance = abs(distance_rad)
    by_speed = _PEAK_SLOPE * distance / PEAK_SPEED_RAD_S[name[-2:]]
    by_acceleration = math.sqrt(_PEAK_CURVATURE * distance / PEAK_ACCELERATION_RAD_S2)
    return max(by_speed, by_acceleration)


@dataclass(frozen=True)
class MoveStep:
    """The next action: command these angles [rad] (None: command nothing), and how the move ended, if it did.

    halt: stop the joints at their present position; the known angles may be outdated.
    """

    command: dict | None
    arrived: bool = False
    failure: str = ""
    halt: bool = False

    @property
    def is_last(self) -> bool:
        return self.arrived or bool(self.failure)


class Move:
    """One move to a target, stepped with what the robot reports.

    Parameters: `start` and `target` as dicts of joint name to rad; `timeout_s`, None for no limit; `threshold_rad`,
    the error below which a joint has arrived. With a threshold above the SDK's tolerance the move ends as soon as it
    is met, for programs that only pass through; otherwise the whole curve is driven and the arm comes to rest first.
    With less time than the curve takes it follows a FilteredPath.
    """

    def __init__(self, start: dict[str, float], target: dict[str, float], timeout_s: float | None,
                 threshold_rad: float = JOINT_ANGLE_TOLERANCE) -> None:
        self._target = dict(target)
        smooth = SmoothPath(start, target)
        self._duration_s = smooth.duration_s
        self._timeout_s = timeout_s
        #: Whether the time is too short for the curve. The last command stays then, and the next call goes on from it.
        self.is_hurried = timeout_s is not None and timeout_s < self._duration_s
        self._path = FilteredPath(start, target) if self.is_hurried else smooth
        self._threshold_rad = threshold_rad
        self._passes_by = self.is_hurried or threshold_rad > JOINT_ANGLE_TOLERANCE
        self._near_since_s = None
        self._disabled_since_s = None

    def step(self, elapsed_s: float, angles: dict[str, float], speeds: dict[str, float], refusal: str = "",
             aborted: bool = False, interrupted: str = "", hindrance: Hindrance = NO_HINDRANCE) -> MoveStep:
        """Decide at `elapsed_s` after the start.

        Parameters: measured `angles` [rad] and `speeds` [rad/s] by joint name (more joints than the target's do no
        harm); `refusal`: why the robot takes no commands, "" if it does; `aborted` by the caller's own test;
        `interrupted`: what has happened to the robot that ends every motion; `hindrance`: what keeps the arm back.
        """
        here = {name: angles[name] for name in self._target}
        if interrupted:
            return MoveStep(None, failure="%s; %s" % (interrupted, self._worst(here)), halt=True)
        # A disabled robot ignores commands: it does not hold the target, even if it is there.
        if not refusal and self._is_there(elapsed_s, here, speeds):
            return MoveStep(dict(self._target), arrived=True)
        if aborted:
            return MoveStep(here, failure="stopped by the test it was given; %s" % self._worst(here))
        if self._lost_power(elapsed_s, not refusal):
            return MoveStep(None, failure="%s; %s" % (refusal, self._worst(here)))
        if hindrance.is_lasting and not self.is_hurried:
            return MoveStep(here, failure="%s; %s" % (hindrance.text, self._worst(here)))
        command = self._path.angles(elapsed_s)
        if self._timeout_s is None or elapsed_s < self._timeout_s:
            return MoveStep(command)
        text = "not there after %.1f s: %s" % (self._timeout_s, self._worst(here))
        if self.is_hurried:
            text += ". A gentle move takes %.1f s" % self._duration_s
        return MoveStep(command, failure=". ".join(filter(None, (text, hindrance.text))))

    def _is_there(self, elapsed_s: float, here: dict[str, float], speeds: dict[str, float]) -> bool:
        near = all(abs(self._target[name] - here[name]) < self._threshold_rad for name in here)
        if self._passes_by:
            return near
        if not near or elapsed_s < self._duration_s:
            self._near_since_s = None
            return False
        if self._near_since_s is None:
            self._near_since_s = elapsed_s
        at_rest = all(abs(speeds.get(name, math.inf)) < SETTLED_SPEED_RAD_S for name in here)
        out_of_time = self._timeout_s is not None and elapsed_s >= self._timeout_s
        return at_rest or out_of_time or elapsed_s - self._near_since_s >= SETTLE_TIME_S

    def _lost_power(self, elapsed_s: float, powered: bool) -> bool:
        if powered:
            self._disabled_since_s = None
            return False
        if self._disabled_since_s is None:
            self._disabled_since_s = elapsed_s
        return elapsed_s - self._disabled_since_s >= DISABLED_GRACE_S

    def _worst(self, here: dict[str, float]) -> str:
        name = max(here, key=lambda joint: abs(self._target[joint] - here[joint]))
        return "%s is %.4f rad from its target %.4f rad (threshold %.4f rad)" % (
            name, abs(self._target[name] - here[name]), self._target[name], self._threshold_rad)
