# SPDX-License-Identifier: BSD-3-Clause
"""Joint names and settings, from config/streamer.yaml, which explains each. Free of ROS."""
from __future__ import annotations

import math
from typing import Any

import baxter_model
from baxter_model import JOINTS, PoseError

# The right arm comes first here, as in Case Western's notes.
SIDES = tuple(reversed(baxter_model.SIDES))
# Choices of these settings; the first is the default.
_CHOICES = {"interpolation": ("fields", "linear", "cubic", "quintic", "time_optimal"),
            "start": ("refuse", "blend", "jump"), "joints": ("any", "right_arm")}
_SWITCHES = ("check_limits", "feedback", "preemption", "stop_when_client_leaves")
_POSITIVE = ("min_segment_s", "rate_hz", "start_tolerance", "max_duration_s", "max_points", "stop_deceleration",
             "goal_tolerance", "settle_time_s", "speed_scale_factor", "cartesian_speed")


class StreamerSettingsError(ValueError):
    """A setting is invalid; the text says what was found and what would be right."""


def arm_joint_names(side: str) -> list[str]:
    """The seven joint names of one arm, from torso to tool flange. Raises StreamerSettingsError for an unknown side."""
    if side not in SIDES:
        raise StreamerSettingsError("there is no arm %r: the arms are %s" % (side, " and ".join(SIDES)))
    return list(baxter_model.joint_names(side))


class StreamerSettings:
    """The checked content of streamer.yaml as attributes of the same names.

    defaults: that content; overrides: dict with some of the same keys. Raises StreamerSettingsError.
    """

    max_velocity: dict[str, float]
    max_acceleration: dict[str, float]
    speed_scale_factor: float
    min_segment_s: float
    cartesian_speed: float
    rate_hz: float
    interpolation: str
    check_limits: bool
    start: str
    joints: str
    feedback: bool
    preemption: bool
    stop_when_client_leaves: bool
    start_tolerance: float
    limit_slack: float
    max_duration_s: float
    max_points: int
    stop_deceleration: float
    goal_tolerance: float
    settle_time_s: float
    poses: dict[str, Any]

    def __init__(self, defaults: dict[str, Any], overrides: dict[str, Any] | None = None) -> None:
        overrides = overrides or {}
        if unknown := sorted(set(overrides) - set(defaults)):
            raise StreamerSettingsError("unknown setting %s; there are %s" % (", ".join(unknown),
                                                                              ", ".join(sorted(defaults))))
        for name, value in {**defaults, **overrides}.items():
            setattr(self, name, value)
        for name in _POSITIVE:
            _require_positive(name, getattr(self, name))
        if self.speed_scale_factor > 1.0:
            raise StreamerSettingsError("speed_scale_factor is %r; it must be at most 1" % self.speed_scale_factor)
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise StreamerSettingsError("%s is %r; choices are %s" % (name, getattr(self, name),
                                                                          ", ".join(choices)))
        for name in _SWITCHES:
            if not isinstance(getattr(self, name), bool):
                raise StreamerSettingsError("%s is %r; it must be true or false" % (name, getattr(self, name)))
        for table in ("max_velocity", "max_acceleration"):
            values = getattr(self, table)
            if set(values) != set(JOINTS):
                raise StreamerSettingsError("%s names %s; it must name %s" % (table, ", ".join(values),
                                                                              ", ".join(JOINTS)))
            for joint, value in values.items():
                _require_positive("%s of %s" % (table, joint), value)

        try:
            self._named_poses = baxter_model.poses().extended(self.poses)
        except PoseError as error:
            raise StreamerSettingsError(str(error)) from error

    def planning_velocity(self) -> list[float]:
        """Velocities of the seven joints that arrival times are computed with [rad/s], scale factor included."""
        return [self.max_velocity[joint] * self.speed_scale_factor for joint in JOINTS]

    def pose(self, name: str, side: str) -> list[float]:
        """The seven angles [rad] of a named pose. Raises StreamerSettingsError for an unknown pose or side."""
        names = arm_joint_names(side)
        try:
            angles = self._named_poses.angles(name, side)
        except PoseError as error:
            raise StreamerSettingsError(str(error)) from error
        return [angles[joint] for joint in names]


def _require_positive(name: str, value: float) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not (math.isfinite(value) and value > 0.0):
        raise StreamerSettingsError("%s is %r; it must be a number above 0" % (name, value))
