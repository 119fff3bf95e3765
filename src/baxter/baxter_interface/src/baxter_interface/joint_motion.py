# SPDX-License-Identifier: BSD-3-Clause
"""A smooth move of some joints to a target, and the check of their arrival. Free of ROS.

Why not send the target and let the robot's own limits shape the move? Because programs expect a gentle move, and after
a step every joint starts at full speed and stops hard. Why not low-pass the command? Because a filter never quite
arrives, starts with a jump of speed, and has a time constant for one loop rate only. A minimum-jerk curve starts and
ends at rest, is the same at any loop rate, ends exactly on the target at a known time, and carries all joints along a
straight line in joint space.
"""
import math
from dataclasses import dataclass

from baxter_model.readiness import ENABLE

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


class SmoothPath:
    """Joint angles over time from `start` to `target` (dicts of joint name to rad, same names)."""

    def __init__(self, start, target):
        self._start = {name: start[name] for name in target}
        self._target = dict(target)
        self.duration_s = max((_duration_s(name, target[name] - start[name]) for name in target), default=0.0)

    def angles(self, time_s):
        """Angles [rad] at `time_s` after the start; exactly the target from `duration_s` on."""
        if time_s >= self.duration_s:
            return dict(self._target)
        u = max(0.0, time_s) / self.duration_s
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        return {name: angle + share * (self._target[name] - angle) for name, angle in self._start.items()}


def _duration_s(name, distance_rad):
    """Shortest time [s] that keeps one joint's speed and acceleration under their peaks."""
    distance = abs(distance_rad)
    by_speed = _PEAK_SLOPE * distance / PEAK_SPEED_RAD_S[name[-2:]]
    by_acceleration = math.sqrt(_PEAK_CURVATURE * distance / PEAK_ACCELERATION_RAD_S2)
    return max(by_speed, by_acceleration)


@dataclass(frozen=True)
class Step:
    """The next action: command these angles [rad] (None: command nothing), and how the move ended, if it did.

    halt: stop the joints at their present position; the known angles may be outdated.
    """

    command: dict | None
    arrived: bool = False
    failure: str = ""
    halt: bool = False

    @property
    def is_last(self):
        return self.arrived or bool(self.failure)


class Move:
    """One move to a target, stepped with what the robot reports.

    Parameters: `start` and `target` as dicts of joint name to rad; `timeout_s`, None for no limit; `threshold_rad`,
    the error below which a joint has arrived. With a threshold above the SDK's tolerance the move ends as soon as it
    is met, for programs that only pass through; otherwise the whole curve is driven and the arm comes to rest first.
    """

    def __init__(self, start, target, timeout_s, threshold_rad=JOINT_ANGLE_TOLERANCE):
        self._target = dict(target)
        self._path = SmoothPath(start, target)
        self._timeout_s = timeout_s
        self._threshold_rad = threshold_rad
        self._passes_by = threshold_rad > JOINT_ANGLE_TOLERANCE
        self._near_since_s = None
        self._disabled_since_s = None

    def step(self, elapsed_s, angles, speeds, enabled=None, aborted=False, interrupted=""):
        """Decide at `elapsed_s` after the start.

        Parameters: measured `angles` [rad] and `speeds` [rad/s] by joint name (more joints than the target's do no
        harm); `enabled` as the robot reports it, None if it does not; `aborted` by the caller's own test;
        `interrupted`: what has happened to the robot that ends every motion.
        """
        here = {name: angles[name] for name in self._target}
        if interrupted:
            return Step(None, failure="%s; %s" % (interrupted, self._worst(here)), halt=True)
        # A disabled robot ignores commands: it does not hold the target, even if it is there.
        powered = enabled is None or enabled
        if powered and self._is_there(elapsed_s, here, speeds):
            return Step(dict(self._target), arrived=True)
        if aborted:
            return Step(here, failure="stopped by the test it was given; %s" % self._worst(here))
        if self._lost_power(elapsed_s, powered):
            return Step(None, failure="the robot is not enabled; %s; enable it: %s" % (
                self._worst(here), ENABLE))
        if self._timeout_s is not None and elapsed_s >= self._timeout_s:
            text = "not there after %.1f s: %s" % (self._timeout_s, self._worst(here))
            if elapsed_s >= self._path.duration_s:
                return Step(dict(self._target), failure=text)
            # The time was too short: the arm stops where it is, since nobody commands the rest of the curve.
            return Step(here, failure="%s. A gentle move takes %.1f s" % (text, self._path.duration_s))
        return Step(self._path.angles(elapsed_s))

    def _is_there(self, elapsed_s, here, speeds):
        near = all(abs(self._target[name] - here[name]) < self._threshold_rad for name in here)
        if self._passes_by:
            return near
        if not near or elapsed_s < self._path.duration_s:
            self._near_since_s = None
            return False
        if self._near_since_s is None:
            self._near_since_s = elapsed_s
        at_rest = all(abs(speeds.get(name, math.inf)) < SETTLED_SPEED_RAD_S for name in here)
        out_of_time = self._timeout_s is not None and elapsed_s >= self._timeout_s
        return at_rest or out_of_time or elapsed_s - self._near_since_s >= SETTLE_TIME_S

    def _lost_power(self, elapsed_s, powered):
        if powered:
            self._disabled_since_s = None
            return False
        if self._disabled_since_s is None:
            self._disabled_since_s = elapsed_s
        return elapsed_s - self._disabled_since_s >= DISABLED_GRACE_S

    def _worst(self, here):
        name = max(here, key=lambda joint: abs(self._target[joint] - here[joint]))
        return "%s is %.4f rad from its target %.4f rad (threshold %.4f rad)" % (
            name, abs(self._target[name] - here[name]), self._target[name], self._threshold_rad)
