# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between ROS messages and this package's own types. Few other modules know messages."""
from __future__ import annotations

from typing import TYPE_CHECKING

from baxter_kinematics_msgs.msg import IKVerdict
from geometry_msgs.msg import Point, Pose, Quaternion
from sensor_msgs.msg import JointState

from arm_kinematics.errors import NoSolution, Reason
from arm_kinematics.target import pose_from_quaternion
from urdf_model.transforms import quaternion_from_matrix

if TYPE_CHECKING:
    from collections.abc import Iterable

    import genpy
    import numpy as np
    from geometry_msgs.msg import PoseStamped, Transform

    from arm_kinematics.chain import Chain

_VERDICTS = {
    Reason.OUT_OF_REACH: IKVerdict.OUT_OF_REACH,
    Reason.JOINT_LIMIT: IKVerdict.JOINT_LIMIT,
    Reason.NOT_CONVERGED: IKVerdict.NOT_CONVERGED,
    Reason.SELF_COLLISION: IKVerdict.SELF_COLLISION,
    Reason.WORLD_COLLISION: IKVerdict.WORLD_COLLISION,
}


def pose_matrix(pose: Pose) -> np.ndarray:
    """Return the (4, 4) matrix of a geometry_msgs/Pose. Raises InvalidTarget when it is not a pose."""
    point, turn = pose.position, pose.orientation
    return pose_from_quaternion((point.x, point.y, point.z), (turn.x, turn.y, turn.z, turn.w))


def transform_matrix(transform: Transform) -> np.ndarray:
    """Return the (4, 4) matrix of a geometry_msgs/Transform. Raises InvalidTarget when it is not a transform."""
    shift = transform.translation
    return pose_matrix(Pose(Point(shift.x, shift.y, shift.z), transform.rotation))


def posture(chain: Chain, joint_state: JointState) -> np.ndarray:
    """Return the posture (n,) of ``chain`` that a sensor_msgs/JointState holds. Raises InvalidPosture."""
    return chain.posture_by_name(list(joint_state.name), list(joint_state.position))


def joint_state(chain: Chain, q: np.ndarray, order: Iterable[str], stamp: genpy.Time) -> JointState:
    """Return a sensor_msgs/JointState of the posture ``q`` (n,), its joints in the given order of names."""
    by_name = dict(zip(chain.joint_names, q.tolist(), strict=True))
    message = JointState(name=list(order), position=[by_name[name] for name in order])
    message.header.stamp = stamp
    return message


def pose_message(matrix: np.ndarray) -> Pose:
    """Return the geometry_msgs/Pose of a (4, 4) matrix."""
    return Pose(Point(*matrix[:3, 3].tolist()), Quaternion(*quaternion_from_matrix(matrix).tolist()))


def verdict(chain: Chain, error: Exception, target: PoseStamped, order: Iterable[str], stamp: genpy.Time) -> IKVerdict:
    """Return the IKVerdict of the exception ``error`` about the PoseStamped ``target``; see :func:`joint_state`."""
    message = IKVerdict(verdict=IKVerdict.INVALID_REQUEST, detail=str(error), target=target)
    if isinstance(error, NoSolution):
        message.verdict = _VERDICTS[error.reason]
        message.joints_there = joint_state(chain, error.best, order, stamp)
        message.nearest = pose_message(error.nearest)
        message.short_m, message.short_rad = error.residual_m, error.residual_rad
        message.joints, message.excess, message.links = list(error.joints), list(error.excess), list(error.pair)
    return message
