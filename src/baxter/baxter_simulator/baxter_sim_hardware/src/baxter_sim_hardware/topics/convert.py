# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between ROS messages and the core's types."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from baxter_core_msgs.msg import AssemblyState, EndpointState, SEAJointState
from control_msgs.msg import JointControllerState
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from sim_time.stamps import stamp
from urdf_model.transforms import quaternion_from_matrix

if TYPE_CHECKING:
    from collections.abc import Sequence
    from io import BytesIO

    import numpy as np

    from baxter_sim_hardware.robot_state import Assembly

_UINT32 = struct.Struct("<I")
_HEADER = struct.Struct("<IIII")  # sequence number, seconds, nanoseconds, length of an empty frame_id


class JointStates:
    """Makes the JointState messages of the same n joints. The names, most of the message, are serialized only once."""

    def __init__(self, names: list[str]) -> None:
        text = [name.encode() for name in names]
        self._names = names
        self._count = _UINT32.pack(len(names))
        self._prepared = self._count + b"".join(_UINT32.pack(len(name)) + name for name in text)

    def message(self, time_s: float, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray) -> JointState:
        """JointState from arrays (n,) in the order of the names."""
        message = _PreparedJointState()
        message.header.stamp = stamp(time_s)
        message.name, message.position, message.velocity, message.effort = self._names, position, velocity, effort
        message.count, message.prepared = self._count, self._prepared
        return message


class _PreparedJointState(JointState):
    count: bytes
    prepared: bytes
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray

    def serialize(self, buff: BytesIO) -> None:
        header = self.header
        parts = [_HEADER.pack(header.seq, header.stamp.secs, header.stamp.nsecs, 0), self.prepared]
        for values in (self.position, self.velocity, self.effort):
            parts += self.count, values.astype("<f8", copy=False).tobytes()
        buff.write(b"".join(parts))


def assembly_state(assembly: Assembly) -> AssemblyState:
    """AssemblyState from `robot_state.Assembly`."""
    return AssemblyState(assembly.ready, assembly.enabled, assembly.stopped, assembly.error,
                         int(assembly.estop_button), int(assembly.estop_source))


def endpoint_state(time_s: float, frame: str, pose: np.ndarray, twist: np.ndarray, wrench: np.ndarray) -> EndpointState:
    """EndpointState in `frame` from a (4, 4) pose and (6,) twist and wrench, linear parts first."""
    pose_msg = Pose(Point(*pose[:3, 3].tolist()), Quaternion(*map(float, quaternion_from_matrix(pose[:3, :3]))))
    linear, angular = twist[:3].tolist(), twist[3:].tolist()
    force, torque = wrench[:3].tolist(), wrench[3:].tolist()
    return EndpointState(Header(stamp=stamp(time_s), frame_id=frame), pose_msg,
                         Twist(Vector3(*linear), Vector3(*angular)), Wrench(Vector3(*force), Vector3(*torque)))


def sea_joint_state(time_s: float, frame: str, names: Sequence[str], commanded: tuple[np.ndarray, ...],
                    measured: tuple[np.ndarray, ...], model: tuple) -> SEAJointState:
    """SEAJointState of k joints.

    commanded: (position, velocity, acceleration, effort), measured: (position, velocity, effort), model: (gravity with
    all corrections, gravity alone, hysteresis, crosstalk): all (k,); at last the state of the hysteresis, a number.
    """
    *efforts, state = model
    return SEAJointState(Header(stamp=stamp(time_s), frame_id=frame), names,
                         *(values.tolist() for values in (*commanded, *measured, *efforts)), float(state))


def joint_controller_state(time_s: float, set_point: float, measured: float, effort: float,
                           dt: float) -> JointControllerState:
    """JointControllerState of one joint without gains, which its drive has not.

    set_point, measured: floats of the same quantity; effort: what the drive exerts [Nm]; dt: length of a tick [s].
    """
    return JointControllerState(header=Header(stamp=stamp(time_s)), set_point=float(set_point),
                                process_value=float(measured), error=float(set_point - measured),
                                time_step=dt, command=float(effort))
