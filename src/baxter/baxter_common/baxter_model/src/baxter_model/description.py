# SPDX-License-Identifier: BSD-3-Clause
"""Facts from Baxter's URDF: the joints of an arm, its tip, its end effector."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from urdf_model import Cylinder, Sphere, merge_fixed

from .errors import ModelMismatch
from .names import BASE_FRAME, SIDES, finger_prefix, is_part_of_arm, joint_names, tip_of
from .self_collision import HEAD_GUARDS

if TYPE_CHECKING:
    from urdf_model.model import Robot


@dataclass(frozen=True)
class LimbModel:
    """One arm in the URDF: its side and the names of its seven joints, torso to wrist."""

    side: str
    joint_names: tuple


def limbs_of(robot: Robot) -> tuple[LimbModel, LimbModel]:
    """The arms of an urdf_model.Robot. Raises ModelMismatch if one lacks a joint or its tip."""
    movable = {joint.name for joint in robot.movable_joints()}
    limbs = []
    for side in SIDES:
        names = joint_names(side)
        missing = [name for name in names if name not in movable]
        missing += [link for link in (BASE_FRAME, tip_of(side)) if link not in robot.links]
        if missing:
            raise ModelMismatch("robot '%s' has no %s; a Baxter has the joints %s and the links %s and %s" % (
                robot.name, ", ".join(missing), ", ".join(names), BASE_FRAME, tip_of(side)))
        limbs.append(LimbModel(side, names))
    return tuple(limbs)


def finger_openings(robot: Robot) -> dict[str, float]:
    """{finger joint: position [m] at which the gripper is open}: the limit that is away from zero."""
    openings = {}
    for joint in robot.movable_joints():
        lower, upper = joint.limit.lower, joint.limit.upper
        if (joint.name.endswith("_finger_joint") and joint.type == "prismatic"
                and lower is not None and upper is not None):
            openings[joint.name] = upper if abs(upper) > abs(lower) else lower
    return openings


def openings_of(robot: Robot, side: str) -> dict[str, float]:
    """`finger_openings` of one arm; empty without an electric gripper."""
    return {name: opening for name, opening in finger_openings(robot).items()
            if name.startswith(finger_prefix(side))}


def head_guards(robot: Robot) -> list[tuple[str, np.ndarray, float]]:
    """[(link, centre (3,) in `base` [m], radius [m])] of the balls around the head that arms must not enter."""
    frames = merge_fixed(robot).frames
    to_base = np.linalg.inv(frames[BASE_FRAME].offset)
    return [(name, (to_base @ frames[name].offset @ shape.origin)[:3, 3], shape.geometry.radius)
            for name in HEAD_GUARDS if name in robot.links and frames[name].link == frames[BASE_FRAME].link
            for shape in robot.links[name].collisions if isinstance(shape.geometry, Sphere)]


def arm_radius(robot: Robot) -> float:
    """Radius of the arms [m]: that of the widest cylinder among their collision shapes; 0 without any."""
    return max((shape.geometry.radius for name, link in robot.links.items()
                if any(is_part_of_arm(name, side) for side in SIDES)
                for shape in link.collisions if isinstance(shape.geometry, Cylinder)), default=0.0)


def avoided_balls(robot: Robot) -> list[tuple[str, np.ndarray, float]]:
    """[(link, centre (3,) in `base` [m], distance [m])]: collision avoidance holds an arm whose middle line, from joint
    number FIRST_AVOIDING on, comes so near to the centre; it is a guard's radius and the arm's."""
    return [(name, centre, radius + arm_radius(robot)) for name, centre, radius in head_guards(robot)]


def cup_of(robot: Robot, side: str) -> Any:
    """(frame at the rim, radius [m]) of the cup that one arm carries, or None.

    Raises ModelMismatch for a cup that is not made of a cylinder.
    """
    link = robot.links.get("%s_gripper_cup" % side)
    if link is None:
        return None
    radii = [shape.geometry.radius for shape in link.collisions if isinstance(shape.geometry, Cylinder)]
    if not radii:
        raise ModelMismatch("link '%s' has no cylinder among its collision shapes; a suction cup is one" % link.name)
    return tip_of(side), max(radii)
