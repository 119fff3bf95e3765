# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between geometry_msgs and the world's own types."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Twist, Vector3
from geometry_msgs.msg import Pose as PoseMsg

from bullet_sim import Pose
from urdf_model import bounds

if TYPE_CHECKING:
    from collections.abc import Iterable


def pose_from_msg(msg: PoseMsg) -> Pose:
    """``geometry_msgs/Pose`` -> :class:`bullet_sim.Pose`; a quaternion of zeros means no rotation.

    Raises ``bullet_sim.BulletSimError`` for numbers that are not finite.
    """
    position, orientation = msg.position, msg.orientation
    return Pose((position.x, position.y, position.z),
                (orientation.x, orientation.y, orientation.z, orientation.w)).checked()


def msg_from_pose(pose: Pose) -> PoseMsg:
    """:class:`bullet_sim.Pose` -> ``geometry_msgs/Pose``."""
    return PoseMsg(Point(*pose.position), Quaternion(*pose.quaternion))


def twist_from_msg(msg: Twist) -> tuple[np.ndarray, np.ndarray]:
    """``geometry_msgs/Twist`` -> (linear, angular) as arrays (3,); raises ``ValueError`` out of bounds."""
    linear = np.array([msg.linear.x, msg.linear.y, msg.linear.z])
    angular = np.array([msg.angular.x, msg.angular.y, msg.angular.z])
    return bounds.SPEED.check(linear, "the linear velocity"), bounds.TURN_RATE.check(angular, "the angular velocity")


def msg_from_twist(linear: Iterable[float], angular: Iterable[float]) -> Twist:
    """Linear [m/s] and angular [rad/s] velocity, (3,) each -> ``geometry_msgs/Twist``."""
    return Twist(Vector3(*linear), Vector3(*angular))


def vector_from_msg(msg: Vector3 | Point, bound: bounds.Bound, what: str) -> np.ndarray:
    """``geometry_msgs/Vector3`` or ``Point`` -> array (3,); raises ``ValueError`` where it is out of ``bound``.

    ``bound``: a ``urdf_model.bounds.Bound``; ``what`` names the vector in the text.
    """
    return bound.check(np.array([msg.x, msg.y, msg.z]), what)
