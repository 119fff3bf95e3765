# SPDX-License-Identifier: BSD-3-Clause
"""Position and velocity limits of the robot's joints, from its description."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import rospy

import urdf_model


class JointLimit(NamedTuple):
    """``lower``, ``upper`` [rad] and ``velocity`` [rad/s]; infinite if the description has none."""

    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf


def read_joint_limits(names: Sequence[str]) -> Any:
    """{joint name: JointLimit} for `names`, from the parameter robot_description.

    Without a readable description, no joint has limits, and one line is logged.
    """
    try:
        joints = urdf_model.parse_urdf(str(rospy.get_param("robot_description")), source="robot_description").joints
    except KeyError:
        rospy.logwarn("the parameter robot_description is not set: the joints' limits are unknown, and not checked")
        joints = {}
    except urdf_model.UrdfError as error:
        rospy.logwarn("the joints' limits are unknown, and not checked: %s", error)
        joints = {}
    return {name: _limit(joints[name].limit) if name in joints else JointLimit() for name in names}


def _limit(limit):
    if limit is None:
        return JointLimit()
    bounds = (limit.lower, limit.upper, limit.velocity)
    return JointLimit(*(bound if known is None else known for known, bound in zip(bounds, JointLimit(), strict=True)))
