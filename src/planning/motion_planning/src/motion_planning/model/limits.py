# SPDX-License-Identifier: BSD-3-Clause
"""Joint limits: the URDF's, narrowed and completed by a ``joint_limits.yaml``."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from urdf_model import Joint, Robot

#: Velocity and acceleration limits if neither file has them [rad/s, rad/s^2; m for a prismatic joint]: MoveIt's
#: defaults.
DEFAULT_VELOCITY, DEFAULT_ACCELERATION = 1.0, 1.0


def narrow_limits(robot: Robot, joint_limits: Mapping[str, Any] | None, warnings: list[str]) -> dict[str, float]:
    """Narrow the positions, and set the velocities, of ``robot``'s joints (in place) as in ``joint_limits``.

    ``joint_limits``: {joint: {min_position, max_position, has_velocity_limits, max_velocity, has_acceleration_limits,
    max_acceleration}}, or a mapping with that under "joint_limits". Returns {joint: acceleration limit}. ``warnings``
    gets the reasons for unusable entries.
    """
    accelerations = {}
    table = joint_limits or {}
    table = table.get("joint_limits", table) or {}
    for name, entry in table.items():
        joint = robot.joints.get(name)
        if not isinstance(entry, dict) or joint is None:
            if isinstance(entry, dict):
                warnings.append("joint limits name '%s', which is not a joint of the robot; ignored" % name)
            continue
        _narrow_position(joint, entry, warnings)
        velocity = _positive(name, entry, "velocity", warnings)
        if velocity is not None:
            joint.limit.velocity = velocity if velocity > 0.0 else None
        acceleration = _positive(name, entry, "acceleration", warnings)
        if acceleration:
            accelerations[name] = acceleration
    return accelerations


def limit_arrays(joints: Sequence[Joint],
                 accelerations: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return bounds (n, 2), velocity (n,), acceleration (n,), continuous (n,) bool of ``joints`` (urdf_model.Joint)."""
    continuous = np.array([joint.type == "continuous" for joint in joints], dtype=bool)
    bounds = np.array([(-math.pi, math.pi) if joint.type == "continuous" else (joint.limit.lower, joint.limit.upper)
                       for joint in joints], dtype=float).reshape(-1, 2)
    velocity = np.array([joint.limit.velocity or DEFAULT_VELOCITY for joint in joints], dtype=float)
    acceleration = np.array([accelerations.get(joint.name, DEFAULT_ACCELERATION) for joint in joints], dtype=float)
    return bounds, velocity, acceleration, continuous


def _narrow_position(joint: Joint, entry: Mapping[str, Any], warnings: list[str]) -> None:
    low, high = (_number(joint.name, entry, key, warnings) for key in ("min_position", "max_position"))
    if not entry.get("has_position_limits", True) or low is high is None:
        return
    if joint.type == "continuous" or joint.limit.lower is None or joint.limit.upper is None:
        warnings.append("joint '%s' is %s; its limits of position are ignored" % (joint.name, joint.type))
        return
    low = joint.limit.lower if low is None else max(low, joint.limit.lower)
    high = joint.limit.upper if high is None else min(high, joint.limit.upper)
    if low > high:
        warnings.append("limits of position of joint '%s' leave nothing of the URDF's %g to %g; ignored"
                        % (joint.name, joint.limit.lower, joint.limit.upper))
        return
    joint.limit.lower, joint.limit.upper = low, high


def _positive(name: str, entry: Mapping[str, Any], what: str, warnings: list[str]) -> float | None:
    """The limit of ``what``: None if there is no entry, 0 if the limit is disabled."""
    if entry.get("has_%s_limits" % what) is False:
        return 0.0
    value = _number(name, entry, "max_" + what, warnings)
    if value is not None and value <= 0.0:
        warnings.append("max_%s of joint '%s' is %g; expected more than 0; ignored" % (what, name, value))
        return None
    return value


def _number(name: str, entry: Mapping[str, Any], key: str, warnings: list[str]) -> float | None:
    value = entry.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        warnings.append("%s of joint '%s' is %r; expected a number; ignored" % (key, name, value))
        return None
    return float(value)
