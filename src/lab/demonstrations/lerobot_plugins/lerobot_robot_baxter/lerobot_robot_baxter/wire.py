# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's messages as LeRobot's numbers, and back. Messages are the dicts of rosbridge.

LeRobot's 16 numbers are `left_s0.pos` … `left_w2.pos` [rad], `left_gripper.pos` (0 closed to 100 open), and the right
arm's.
"""
from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

SIDES = ("left", "right")
_JOINTS = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
JOINTS = {side: tuple("%s_%s" % (side, joint) for joint in _JOINTS) for side in SIDES}
#: Names of the numbers in their order.
NUMBERS = tuple("%s.pos" % name for side in SIDES for name in (*JOINTS[side], "%s_gripper" % side))
CLOSED, OPEN = 0.0, 100.0
#: Grippers are as good as closed or open when they are so near to it [%].
NEAR = 1.0
JOINT_STATES, SET_POINTS, ROBOT_STATE = "/robot/joint_states", "/robot/ref_joint_states", "/robot/state"
ENABLE, MARKS = "/robot/set_super_enable", "/steering/mark"
_GRIPPER = "/robot/end_effector/%s_gripper/%s"
_POSITION_MODE = 1
_SENDER = "lerobot"

#: {topic: type} of what is published and subscribed.
TYPES: dict[str, str] = {
    JOINT_STATES: "sensor_msgs/JointState", SET_POINTS: "sensor_msgs/JointState",
    ROBOT_STATE: "baxter_core_msgs/AssemblyState", ENABLE: "std_msgs/Bool", MARKS: "std_msgs/String"}


def arm_topic(side: str) -> str:
    """Where an arm's commands go."""
    return "/robot/limb/%s/joint_command" % side


def gripper_topic(side: str, what: str) -> str:
    """what: command or state."""
    return _GRIPPER % (side, what)


for _side in SIDES:
    TYPES[arm_topic(_side)] = "baxter_core_msgs/JointCommand"
    TYPES[gripper_topic(_side, "command")] = "baxter_core_msgs/EndEffectorCommand"
    TYPES[gripper_topic(_side, "state")] = "baxter_core_msgs/EndEffectorState"


def has_both_arms(message: Mapping[str, Any]) -> bool:
    """Whether a JointState is of both arms: drivers of grippers send others on the same topic."""
    return {name for side in SIDES for name in JOINTS[side]} <= set(message["name"])


def angles(message: Mapping[str, Any]) -> dict[str, float]:
    """{`left_s0.pos`: rad} of a JointState with both arms."""
    at = dict(zip(message["name"], message["position"], strict=True))
    return {"%s.pos" % name: float(at[name]) for side in SIDES for name in JOINTS[side]}


def gripper_wanted(command: Mapping[str, Any], before: float) -> float:
    """How far open a gripper is to be [%] after an EndEffectorCommand."""
    if command["command"] == "grip":
        return CLOSED
    if command["command"] == "release":
        return OPEN
    if command["command"] == "go":
        try:
            position = float(json.loads(command["args"])["position"])
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            return before
        return before if math.isnan(position) else min(max(position, CLOSED), OPEN)
    return before


def checked(action: Mapping[str, Any]) -> dict[str, float]:
    """An action's 16 numbers. Raises ValueError for missing and unknown names, and for numbers that are not finite."""
    if set(action) != set(NUMBERS):
        raise ValueError("an action has exactly the numbers %s; missing: %s; unknown: %s" % (
            ", ".join(NUMBERS), ", ".join(sorted(set(NUMBERS) - set(action))) or "none",
            ", ".join(sorted(set(action) - set(NUMBERS))) or "none"))
    found = {name: float(action[name]) for name in NUMBERS}
    if bad := [name for name, value in found.items() if not math.isfinite(value)]:
        raise ValueError("an action's numbers must be finite; found %s" % ", ".join(
            "%s %s" % (name, found[name]) for name in bad))
    return found


def limited(before: Mapping[str, float], wanted: Mapping[str, float], most: float) -> dict[str, float]:
    """Set-points on the straight way from `before` to `wanted` [rad], such that no joint of an arm goes further than
    `most`; grippers are left out."""
    found = {}
    for side in SIDES:
        names = ["%s.pos" % name for name in JOINTS[side]]
        furthest = max(abs(wanted[name] - before[name]) for name in names)
        share = 1.0 if furthest <= most else most / furthest
        found |= {name: before[name] + share * (wanted[name] - before[name]) for name in names}
    return found


def joint_command(side: str, set_points: Mapping[str, float]) -> dict[str, Any]:
    """A JointCommand in position mode."""
    return {"mode": _POSITION_MODE, "names": list(JOINTS[side]),
            "command": [set_points["%s.pos" % name] for name in JOINTS[side]]}


def gripper_command(opening: float, id_: int, sequence: int) -> dict[str, Any]:
    """An EndEffectorCommand for an opening [%]."""
    opening = min(max(opening, CLOSED), OPEN)
    kind = "grip" if opening <= CLOSED + NEAR else "release" if opening >= OPEN - NEAR else "go"
    return {"id": id_, "command": kind, "args": json.dumps({"position": opening}) if kind == "go" else "",
            "sender": _SENDER, "sequence": sequence}
