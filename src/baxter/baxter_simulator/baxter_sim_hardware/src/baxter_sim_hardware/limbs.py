# SPDX-License-Identifier: BSD-3-Clause
"""What the URDF says about Baxter: which joints make an arm, where its tip is, how far its fingers open."""
from .arms import LimbModel
from .errors import ModelMismatch
from .joint_command import JOINT_SUFFIXES
from .sides import SIDES

BASE_FRAME = "base"


def tip_of(side):
    """Name of the frame that end-point topics and the IK service mean."""
    return "%s_gripper" % side


def limbs_of(robot):
    """The arms of an urdf_model.Robot. Raises ModelMismatch where one lacks a joint or its tip."""
    movable = {joint.name for joint in robot.movable_joints()}
    limbs = []
    for side in SIDES:
        names = tuple("%s_%s" % (side, suffix) for suffix in JOINT_SUFFIXES)
        missing = [name for name in names if name not in movable]
        missing += [link for link in (BASE_FRAME, tip_of(side)) if link not in robot.links]
        if missing:
            raise ModelMismatch("robot '%s' has no %s; a Baxter has the joints %s and the links %s and %s" % (
                robot.name, ", ".join(missing), ", ".join(names), BASE_FRAME, tip_of(side)))
        limbs.append(LimbModel(side, names))
    return tuple(limbs)


def finger_openings(robot):
    """{finger joint: position [m] at which the gripper is open}: the limit that is away from zero."""
    openings = {}
    for joint in robot.movable_joints():
        if joint.name.endswith("_finger_joint") and joint.type == "prismatic":
            lower, upper = joint.limit.lower, joint.limit.upper
            openings[joint.name] = upper if abs(upper) > abs(lower) else lower
    return openings
