# SPDX-License-Identifier: BSD-3-Clause
"""Names of sides, joints, frames and links, and how one arm mirrors the other.

The description (baxter_description) spells the same names. It is not read here: expanding it takes longer than starting
most programs. The tests of this package compare the two.
"""

from __future__ import annotations

SIDES = ("left", "right")

# Sign of a joint's angle on one arm where the other arm is its mirror image, from shoulder to wrist.
MIRROR_SIGNS = {"s0": -1, "s1": 1, "e0": -1, "e1": 1, "w0": -1, "w1": 1, "w2": -1}
# From shoulder to wrist: the order of every array of seven in this workspace.
JOINTS = tuple(MIRROR_SIGNS)

HEAD_JOINT = "head_pan"

# The reference frame of poses; also the fixed link of the torso.
BASE_FRAME = "base"
BASE_HEIGHT_M = 0.93  # of it above the floor, on the pedestal


def joint_names(side: str) -> tuple[str, ...]:
    """Return the seven joint names of one arm, from shoulder to wrist."""
    return tuple("%s_%s" % (side, joint) for joint in JOINTS)


def tip_of(side: str) -> str:
    """Return the name of the tip frame of the end-point topics and the IK service."""
    return "%s_gripper" % side


def other_side(side: str) -> str:
    """Return "right" for "left", and "left" for "right"."""
    return SIDES[1 - SIDES.index(side)]


def mirrored(angles: dict[str, float]) -> dict[str, float]:
    """Return {joint without its side: angle [rad]} of the other arm in the mirrored posture."""
    return {joint: MIRROR_SIGNS[joint] * angle for joint, angle in angles.items()}


def named(side: str, angles: dict[str, float]) -> dict[str, float]:
    """Return {joint name: angle [rad]} of one arm for {joint without its side: angle [rad]}."""
    # Adding zero makes 0.0 of -0.0, and a float of what a file gave as an integer.
    return {"%s_%s" % (side, joint): angle + 0.0 for joint, angle in angles.items()}


def arm_angles(side: str, left: dict[str, float]) -> dict[str, float]:
    """Return {joint name: angle [rad]} of one arm, for a posture that is given for the left arm.

    left: {joint without its side, such as "s0": angle [rad]}. The right arm gets the mirror image.
    """
    return named(side, left if side == SIDES[0] else mirrored(left))


def finger_prefix(side: str) -> str:
    """Return the prefix of the names of one electric gripper's links and joints."""
    return "%s_gripper_" % side[0]


def is_part_of_arm(link: str, side: str) -> bool:
    """Whether a link belongs to one arm, by its name; fingers have only the first letter of their side."""
    return link.startswith((side + "_", finger_prefix(side)))
