# SPDX-License-Identifier: BSD-3-Clause
"""Names and units of the numbers in observations and actions, in their order: for data sets, and for the contracts of
policies."""
from __future__ import annotations

from collections.abc import Sequence

from baxter_model import JOINTS

from .controls import CONTROLS

#: (name, unit of the International System or "")
Named = tuple[str, str]
_PLACE, _TURN = ("x", "y", "z"), ("qx", "qy", "qz", "qw")


def places(thing: str) -> tuple[Named, ...]:
    """Of (3,) coordinates."""
    return tuple(("%s.%s" % (thing, axis), "m") for axis in _PLACE)


def poses(thing: str) -> tuple[Named, ...]:
    """Of (7,): coordinates, and a quaternion x y z w."""
    return (*places(thing), *(("%s.%s" % (thing, part), "") for part in _TURN))


def robot_names(sides: Sequence[str]) -> tuple[Named, ...]:
    """Of `Core.agent_pos`."""
    found: list[Named] = []
    for side in sides:
        found += [("%s_%s.pos" % (side, joint), "rad") for joint in JOINTS]
        found += [("%s_%s.vel" % (side, joint), "rad/s") for joint in JOINTS]
        found += [*poses("%s_hand" % side), ("%s_gripper.open" % side, "")]
    return tuple(found)


def action_names(control: str, sides: Sequence[str]) -> tuple[Named, ...]:
    """Of an action; its numbers are from -1 to 1. Raises ValueError for an unknown control."""
    if control not in CONTROLS:
        raise ValueError("control is %r; choices are %s" % (control, ", ".join(CONTROLS)))
    found: list[Named] = []
    for side in sides:
        if control == "osc_pose":
            found += [("%s_hand.%s" % (side, part), "") for part in ("dx", "dy", "dz", "rx", "ry", "rz")]
        else:
            found += [("%s_%s.%s" % (side, joint, "delta" if control == "joint_delta" else "pos"), "")
                      for joint in JOINTS]
        found.append(("%s_gripper.close" % side, ""))
    return tuple(found)
