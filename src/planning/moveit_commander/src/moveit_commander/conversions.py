# SPDX-License-Identifier: BSD-3-Clause
"""Messages as lists and as bytes, and back. Positions in m; quaternions x, y, z, w; roll, pitch, yaw in rad."""
from __future__ import annotations

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, Vector3

from command_line.options import counted
from urdf_model.transforms import (
    matrix_from_quaternion,
    pose_matrix,
    quaternion_from_matrix,
    rigid,
)

from .exception import MoveItCommanderException

if TYPE_CHECKING:
    import genpy

__all__ = ["list_to_pose", "list_to_pose_stamped", "list_to_transform", "msg_from_string", "msg_to_string",
           "pose_to_list", "transform_to_list"]


def msg_to_string(msg: genpy.Message) -> bytes:
    """Return a message as the bytes that go over the wire."""
    buffer = io.BytesIO()
    msg.serialize(buffer)
    return buffer.getvalue()


def msg_from_string(msg: genpy.Message, data: bytes) -> None:
    """Fill ``msg`` from bytes. Raises genpy.DeserializationError for bytes of another type."""
    msg.deserialize(data)


def pose_to_list(pose_msg: Pose) -> list[float]:
    """Return [x, y, z, qx, qy, qz, qw] of a geometry_msgs/Pose."""
    point, turn = pose_msg.position, pose_msg.orientation
    return [point.x, point.y, point.z, turn.x, turn.y, turn.z, turn.w]


def list_to_pose(pose_list: Iterable[float]) -> Pose:
    """Return the Pose of [x, y, z, qx, qy, qz, qw] or [x, y, z, roll, pitch, yaw].

    Raises MoveItCommanderException for another number of values.
    """
    values = [float(value) for value in pose_list]
    if len(values) == 7:
        turn = values[3:]
    elif len(values) == 6:
        turn = quaternion_from_matrix(pose_matrix(rpy=values[3:])).tolist()
    else:
        raise MoveItCommanderException("a pose is x, y, z and either a quaternion (7 values) or roll, pitch, yaw (6); "
                                       "got %s" % counted(len(values), "value"))
    return Pose(Point(*values[:3]), Quaternion(*turn))


def list_to_pose_stamped(pose_list: Iterable[float], target_frame: str) -> PoseStamped:
    """Return the PoseStamped of :func:`list_to_pose` in the frame ``target_frame``; its stamp is zero."""
    message = PoseStamped(pose=list_to_pose(pose_list))
    message.header.frame_id = target_frame
    return message


def transform_to_list(trf_msg: Transform) -> list[float]:
    """Return [x, y, z, qx, qy, qz, qw] of a geometry_msgs/Transform."""
    shift, turn = trf_msg.translation, trf_msg.rotation
    return [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z, turn.w]


def list_to_transform(trf_list: Iterable[float]) -> Transform:
    """Return the Transform of 7 values or 6, as :func:`list_to_pose` takes them."""
    pose = list_to_pose(trf_list)
    return Transform(Vector3(pose.position.x, pose.position.y, pose.position.z), pose.orientation)


def matrix_of(pose: Pose) -> np.ndarray:
    """Return the (4, 4) matrix of a Pose; a quaternion of zeros counts as no rotation, as in move_group."""
    values = pose_to_list(pose)
    turn = values[3:] if any(values[3:]) else [0.0, 0.0, 0.0, 1.0]
    return rigid(matrix_from_quaternion(turn), values[:3])


def pose_of(matrix: np.ndarray) -> Pose:
    """Return the Pose of a (4, 4) matrix."""
    return list_to_pose([*matrix[:3, 3].tolist(), *quaternion_from_matrix(matrix).tolist()])
