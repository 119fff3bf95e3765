# SPDX-License-Identifier: BSD-3-Clause
"""Why a trajectory is refused: one class per cause; each text says what was found and what would be right."""
from __future__ import annotations

from collections.abc import Iterable, Sequence


class TrajectoryError(Exception):
    """Base class of this package's errors."""


class JointNamesError(TrajectoryError):
    """The joints of a trajectory are not the controlled ones. ``names``: the wrong names."""

    def __init__(self, names: Iterable[str], text: str) -> None:
        super().__init__(text)
        self.names = tuple(names)


class NoJointNames(JointNamesError):
    """``joint_names`` is empty."""

    def __init__(self, known: Iterable[str]) -> None:
        super().__init__((), "joint_names is empty, expected %s" % ", ".join(known))


class UnknownJoints(JointNamesError):
    """The trajectory names joints that are not controlled."""

    def __init__(self, names: Sequence[str], known: Iterable[str]) -> None:
        super().__init__(names, "unknown joint %s, expected %s" % (", ".join(names), ", ".join(known)))


class RepeatedJoints(JointNamesError):
    """The trajectory names joints more than once."""

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__(names, "joint_names has %s more than once" % ", ".join(names))


class MissingJoints(JointNamesError):
    """The trajectory must name all joints, and some are missing."""

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__(names, "joint_names lacks %s; all joints must be named (allow_partial_joints_goal is false)"
                         % ", ".join(names))


class NoPoints(TrajectoryError):
    """The trajectory has no points, where it needs some."""

    def __init__(self) -> None:
        super().__init__("the trajectory has no points; give it at least one, with a time_from_start above 0")


class BeyondLimit(TrajectoryError):
    """``joint`` would go beyond its ``limit`` with ``value``, ``time_s`` [s] after the start of the trajectory."""

    def __init__(self, joint: str, value: float, limit: float, time_s: float, text: str) -> None:
        super().__init__("%s would have to %s" % (joint, text % (value, time_s, limit)))
        self.joint, self.value, self.limit, self.time_s = joint, value, limit, time_s


class BeyondPosition(BeyondLimit):
    """The joint cannot reach a position [rad or m]."""

    def __init__(self, joint: str, value: float, limit: float, time_s: float) -> None:
        super().__init__(joint, value, limit, time_s, "be at %f at %.3f s; its limit is %f")


class BeyondVelocity(BeyondLimit):
    """The joint cannot move this fast [rad/s or m/s]."""

    def __init__(self, joint: str, value: float, limit: float, time_s: float) -> None:
        super().__init__(joint, value, limit, time_s, "move at %f per s from %.3f s on; its limit is %f per s")


class NoPositions(TrajectoryError):
    """A point has no positions."""

    def __init__(self, point: int) -> None:
        super().__init__("point %d has no positions; every point needs one for each joint" % point)
        self.point = point


_ONE = {"positions": "position", "velocities": "velocity", "accelerations": "acceleration"}


class WrongSize(TrajectoryError):
    """The length of a point's field is not the number of joints."""

    def __init__(self, point: int, field: str, found: int, expected: int) -> None:
        optional = "" if field == "positions" else " or none"
        noun = _ONE.get(field, field) if found == 1 else field
        super().__init__("point %d has %d %s, expected %d%s" % (point, found, noun, expected, optional))
        self.point, self.field, self.found, self.expected = point, field, found, expected


class NotFinite(TrajectoryError):
    """A field of a point has NaN or infinity."""

    def __init__(self, point: int, field: str) -> None:
        super().__init__("point %d has %s that are not finite numbers" % (point, field))
        self.point, self.field = point, field


class TimesNotIncreasing(TrajectoryError):
    """``time_from_start`` [s] of a point is not above that of the point before."""

    def __init__(self, point: int, time_s: float, before_s: float) -> None:
        super().__init__("time_from_start must increase: point %d has %.9g s after %.9g s" % (point, time_s, before_s))
        self.point, self.time_s, self.before_s = point, time_s, before_s


class AllPointsInPast(TrajectoryError):
    """All points are in the past: ``dropped`` points, the last one due ``late_s`` [s] ago."""

    def __init__(self, dropped: int, late_s: float) -> None:
        if late_s > 0.0:
            text = "all points (%d) are in the past, the last one by %.6f s; check header.stamp" % (dropped, late_s)
        else:
            text = "the last point (of %d) is due at once; give it a time_from_start above 0" % dropped
        super().__init__(text)
        self.dropped, self.late_s = dropped, late_s


class BeforeTrajectory(TrajectoryError):
    """The time [s] is before the trajectory's start."""

    def __init__(self, time_s: float, start_time: float) -> None:
        super().__init__("the time asked for is %.6f s before the start of the trajectory" % (start_time - time_s))
        self.time_s, self.start_time = time_s, start_time
