# SPDX-License-Identifier: BSD-3-Clause
"""Set-points on the way to targets: slowly, within the joints' limits, all joints of one request at the same time. No
ROS.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from web_bridge.errors import shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from urdf_model import Joint

#: Share of a joint's velocity limit that the page's motions use.
SPEED_SHARE = 0.25
#: Time in which a joint reaches its speed [s].
RAMP_S = 0.25
#: A set-point waits for a joint that is further behind than this [rad], or silent: an obstacle, a paused simulation.
LEAD_RAD = 0.2
#: Something else has moved a joint that is further than this from its set-point [rad]: a reset of the world, a hand.
#: Going on would take it there at its full speed.
LOST_RAD = 2.0 * LEAD_RAD
#: A joint that is further behind its set-point than this [rad] is held by something; a free one is by 0.03 s of its
#: speed, and by 0.15 s of it beside other work on the machine.
FREE_RAD = 0.5 * LEAD_RAD
#: A joint that is nearer to its target than this has arrived [rad]; a loaded one sags a little.
ARRIVED_RAD = 0.03
#: A joint stands still that is behind its set-point by more than ARRIVED_RAD, and has not moved this far [rad] for so
#: long [s].
STILL_RAD, STILL_S = 0.01, 1.5
#: A set-point nearer to its target than this has arrived [rad].
NEAR_RAD = 1e-4


class PageJointLimits(NamedTuple):
    """Of one joint: ``lower``, ``upper`` [rad], ``velocity`` [rad/s]."""

    lower: float
    upper: float
    velocity: float


def limits_of(joints: Mapping[str, Joint], names: Iterable[str]) -> dict[str, PageJointLimits]:
    """{name: PageJointLimits} of those ``names`` in ``joints`` {name: urdf_model.Joint} that have bounds and a speed;
    others cannot be moved.
    """
    limits = {name: joints[name].limit for name in names if name in joints}
    return {name: PageJointLimits(limit.lower, limit.upper, limit.velocity) for name, limit in limits.items()
            if limit is not None and limit.lower is not None and limit.upper is not None and limit.velocity}


class MotionError(Exception):
    """A target that no joint can take; the text says which, and what is possible."""


def check_not_lost(setpoints: Mapping[str, float], measured: Mapping[str, float]) -> None:
    """Raise MotionError where something else has moved a joint away from its set-point; both {joint: [rad]}."""
    for joint, position in setpoints.items():
        if abs(position - measured.get(joint, position)) > LOST_RAD:
            raise MotionError("something else has moved %s: it is at %.2f rad, and was sent to %.2f rad"
                              % (joint, measured[joint], position))


class JointStandstill:
    """Notices a joint that does not follow its set-points."""

    def __init__(self) -> None:
        self._since = {}  # joint -> (time [s], position [rad])

    def look(self, time_s: float, setpoints: Mapping[str, float], measured: Mapping[str, float]) -> str:
        """A joint that stands still, or "". ``time_s``: the robot's time, which may pause [s]; ``setpoints``,
        ``measured``: {joint: [rad]}.
        """
        behind = {joint: measured[joint] for joint, setpoint in setpoints.items()
                  if joint in measured and abs(setpoint - measured[joint]) > ARRIVED_RAD}
        self._since = {
            joint: since if since[0] <= time_s and abs(position - since[1]) < STILL_RAD else (time_s, position)
            for joint, position in behind.items() for since in [self._since.get(joint, (time_s, position))]}
        return next((joint for joint, (since_s, _) in self._since.items() if time_s - since_s >= STILL_S), "")


def held(joints: Iterable[str], setpoints: Mapping[str, float], measured: Mapping[str, float]) -> dict[str, float]:
    """Where ``joints`` that move stop: {joint: [rad]} of those with a measured position, at once and without turning
    back. ``setpoints``: the last ones; both {joint: [rad]}.

    A free joint is a little behind its set-point, and stops there. One that is held by something stays where it is.
    """
    return {joint: setpoints[joint] if abs(setpoints.get(joint, math.inf) - measured[joint]) <= FREE_RAD
            else measured[joint] for joint in joints if joint in measured}


class _Course:
    """One joint's way: position [rad] and velocity [rad/s] of the set-point."""

    def __init__(self, position: float) -> None:
        self.position = position
        self.velocity = 0.0
        self.target = position
        self.speed = self.rate = 0.0

    def way(self, target: float, full_speed: float) -> float:
        """The way to ``target`` [rad]; a joint that moves passes the place where it can come to rest."""
        rest = self.position + 0.5 * RAMP_S / full_speed * self.velocity * abs(self.velocity)
        return max(abs(target - self.position), abs(target - rest))

    def aim(self, target: float, speed: float) -> None:
        """Go to ``target`` [rad] at ``speed`` [rad/s]."""
        self.target, self.speed = target, speed
        # A slow course after a fast one still brakes as quickly as the fast one would have.
        self.rate = max(speed, abs(self.velocity)) / RAMP_S

    def step(self, dt: float, limits: PageJointLimits) -> bool:
        """Advance by ``dt`` [s]; returns whether the target is reached."""
        rate = self.rate
        away = self.target - self.position
        wanted = math.copysign(min(self.speed, math.sqrt(2.0 * rate * abs(away))), away)
        self.velocity += max(-rate * dt, min(rate * dt, wanted - self.velocity))
        if abs(away) <= max(NEAR_RAD, abs(self.velocity) * dt) and abs(self.velocity) <= 2.0 * rate * dt + NEAR_RAD:
            self.position, self.velocity = self.target, 0.0
            return True
        self.position = max(limits.lower, min(limits.upper, self.position + self.velocity * dt))
        return False


class PageMotion:
    """``limits`` {joint: PageJointLimits}. Not safe for threads."""

    def __init__(self, limits: Mapping[str, PageJointLimits]) -> None:
        self.limits = dict(limits)
        self._courses = {}

    @property
    def is_moving(self) -> bool:
        return bool(self._courses)

    def aim(self, targets: Mapping[str, float], measured: Mapping[str, float]) -> None:
        """Go to ``targets`` {joint: [rad]} from ``measured`` {joint: [rad]}, or from where the set-points are now.

        Raises MotionError for an unknown joint, a target outside of its limits and a joint without a measured position;
        nothing changes then.
        """
        if not targets:
            raise MotionError("no joint is named")
        for joint, target in targets.items():
            limits = self.limits.get(joint)
            if limits is None:
                raise MotionError("there is no joint '%s' to move; there are %s" % (joint, ", ".join(self.limits)))
            if isinstance(target, bool) or not isinstance(target, int | float):
                raise MotionError("the target of %s is %r; a number is expected [rad]" % (joint, target))
            # NaN, and whole numbers that no float can hold, are not within the limits either.
            if not limits.lower <= target <= limits.upper:
                raise MotionError("%s cannot go to %s rad; %.4f to %.4f is possible"
                                  % (joint, shown(target), limits.lower, limits.upper))
            if joint not in measured:
                raise MotionError("the position of %s is not known yet" % joint)
        courses = {joint: self._courses.get(joint) or _Course(measured[joint]) for joint in targets}
        full = {joint: SPEED_SHARE * self.limits[joint].velocity for joint in courses}
        ways = {joint: course.way(targets[joint], full[joint]) for joint, course in courses.items()}
        duration = max(RAMP_S, *(way / full[joint] for joint, way in ways.items()))
        for joint, course in courses.items():
            course.aim(float(targets[joint]), ways[joint] / duration or full[joint])
        self._courses.update(courses)

    def stop(self) -> bool:
        """Forget all targets; returns whether there were any."""
        moved, self._courses = bool(self._courses), {}
        return moved

    def step(self, dt: float, measured: Mapping[str, float]) -> dict[str, float]:
        """The set-points {joint: [rad]} after ``dt`` [s]; joints that have arrived are in it for the last time.

        Raises MotionError where something else has moved a joint; nothing changes then.
        """
        check_not_lost({joint: course.position for joint, course in self._courses.items()}, measured)
        setpoints = {}
        for joint, course in list(self._courses.items()):
            behind = abs(course.position - measured.get(joint, math.inf))
            if behind <= LEAD_RAD and course.step(dt, self.limits[joint]) and behind <= ARRIVED_RAD:
                del self._courses[joint]
            setpoints[joint] = course.position
        return setpoints
