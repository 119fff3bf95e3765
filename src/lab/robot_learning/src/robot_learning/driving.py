# SPDX-License-Identifier: BSD-3-Clause
"""When a policy may move a robot, and how fast: dead-man's switch, limits, reasons to stop. Free of ROS."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baxter_model import readiness

#: What a policy's node tells about itself.
WAITING, ACTING, SUCCEEDED, FAILED, STOPPED = "waiting", "acting", "success", "failure", "stopped"


@dataclass(frozen=True)
class DrivingLimits:
    """hold_s: age of the last message of the switch [s]; seen_s: age of what is observed [s]; speed_rad_s: of a joint's
    set-points; off_rad: of a joint from its set-point, more means that something is in the way."""

    hold_s: float = 0.3
    seen_s: float = 0.25
    speed_rad_s: float = 1.5
    off_rad: float = 0.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError("%s is %r; it must be above 0" % (name, value))


@dataclass(frozen=True)
class Situation:
    """held_s: since the switch was last held [s], infinite if never; seen_s: age of the oldest thing observed [s];
    enabled: whether the robot is; stopped: whether its stop is pressed; off_rad: greatest distance of a joint from its
    set-point [rad]."""

    held_s: float
    seen_s: float
    enabled: bool
    stopped: bool
    off_rad: float = 0.0


def reason_to_wait(limits: DrivingLimits, now: Situation) -> str:
    """Why the policy must not move the robot now, "" if it may."""
    if now.stopped:
        return readiness.STOPPED
    if not now.enabled:
        return readiness.NOT_ENABLED
    if now.seen_s > limits.seen_s:
        return "what is observed is %.2f s old; at most %.2f s are allowed" % (now.seen_s, limits.seen_s)
    if now.held_s > limits.hold_s:
        return "the switch is not held: true on ~hold at least every %.2f s" % limits.hold_s
    if now.off_rad > limits.off_rad:
        return "a joint is %.2f rad from its set-point, at most %.2f are allowed: something may be in the way" % (
            now.off_rad, limits.off_rad)
    return ""


def limited(before: np.ndarray, target: np.ndarray, most: float) -> np.ndarray:
    """The target, or a point on the way to it from `before` (7,), such that no joint goes further than `most`."""
    way = target - before
    furthest = float(np.abs(way).max(initial=0.0))
    return target if furthest <= most else before + way * (most / furthest)
