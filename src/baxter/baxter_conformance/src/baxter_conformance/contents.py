# SPDX-License-Identifier: BSD-3-Clause
"""Checks of messages and values that programs must understand; each returns None, or the fault as a text.

The rules are those that the vendor's clients rely on.
"""
from __future__ import annotations

import math
import re
from fnmatch import fnmatchcase
from typing import Any

from baxter_model import CUSTOM, ELECTRIC, SIDES, SUCTION, joint_names

ARM_JOINTS = tuple(name for side in SIDES for name in joint_names(side))
UI_TYPES = {kind.ui_type for kind in (CUSTOM, ELECTRIC, SUCTION)}
SUPPORTED_SOFTWARE = r"1\.2\.\d+(\.|$|-)"
GRAVITY = 9.81  # [m/s^2]


def joint_state(message: Any) -> str | None:
    """Names without repetition, and a position, velocity and effort for each.

    The grippers' fingers of a physical robot come from another publisher, so a message need not have all joints.
    """
    count = len(message.name)
    lengths = [len(message.position), len(message.velocity), len(message.effort)]
    if lengths != [count] * 3:
        return "%d names, but %d positions, %d velocities, %d efforts" % (count, *lengths)
    if len(set(message.name)) != count:
        return "a joint is named twice"
    if not all(map(math.isfinite, (*message.position, *message.velocity, *message.effort))):
        return "a value is not finite"
    return None


def joint_states(message: Any) -> str | None:
    """All joints of both arms, if any of an arm, and the rules of joint_state."""
    missing = [name for name in ARM_JOINTS if name not in message.name]
    if missing and len(missing) < len(ARM_JOINTS):
        return "joints are missing: " + ", ".join(missing)
    return joint_state(message)


def endpoint_state(message: Any) -> str | None:
    q = message.pose.orientation
    length = math.sqrt(q.x ** 2 + q.y ** 2 + q.z ** 2 + q.w ** 2)
    return None if abs(length - 1.0) < 0.01 else "the orientation's quaternion has length %.3g, not 1" % length


def gripper_properties(message: Any) -> str | None:
    if message.ui_type in UI_TYPES:
        return None
    return "ui_type is %d; clients understand %s" % (message.ui_type, ", ".join(map(str, sorted(UI_TYPES))))


def digital_io(message: Any) -> str | None:
    return None if message.state in (0, 1) else "state is %d, neither 0 nor 1" % message.state


def navigator(message: Any) -> str | None:
    found = [list(message.button_names), list(message.light_names)]
    expected = [["ok", "back", "show"], ["inner", "outer"]]
    return None if found == expected else "buttons and lights are %s, not %s" % (found, expected)


def hand_range(message: Any) -> str | None:
    if message.min_range < message.max_range:
        return None
    return "min_range %g is not less than max_range %g" % (message.min_range, message.max_range)


def accelerometer(message: Any) -> str | None:
    a = message.linear_acceleration
    size = math.sqrt(a.x ** 2 + a.y ** 2 + a.z ** 2)
    return None if 0.5 * GRAVITY < size < 1.5 * GRAVITY else "acceleration of %.3g m/s^2, not about 9.81" % size


CHECKS = {
    "/robot/joint_states": joint_states,
    "/robot/ref_joint_states": joint_state,
    "/robot/limb/*/*endpoint_state": endpoint_state,
    "/robot/end_effector/*_gripper/properties": gripper_properties,
    "/robot/digital_io/*/state": digital_io,
    "/robot/navigators/*_navigator/state": navigator,
    "/robot/range/*_hand_range/state": hand_range,
    "/robot/accelerometer/*_accelerometer/state": accelerometer,
}


def wrong_with_message(topic: str, message: Any) -> str | None:
    """The fault of a topic's message, or None."""
    for pattern, check in CHECKS.items():
        if fnmatchcase(topic, pattern):
            return check(message)
    return None


def wrong_with_parameter(name: str, kind: str, value: Any) -> Any:
    """The fault of a parameter's value, or None. kind: "text" or "names"."""
    if kind == "text":
        if not isinstance(value, str) or not value:
            return "is %r, not a text" % (value,)
    elif not isinstance(value, list) or not value or not all(isinstance(one, str) for one in value):
        return "is %r, not a list of names" % (value,)
    if name == "/rethink/software_version" and not re.match(SUPPORTED_SOFTWARE, str(value)):
        return "is %r; the SDK supports 1.2.x" % value
    for side in SIDES:
        names = list(joint_names(side))
        if name == "/robot_config/%s_config/joint_names" % side and value != names:
            return "is %s, not %s" % (value, names)
    return None
