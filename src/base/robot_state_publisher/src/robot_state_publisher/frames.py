# SPDX-License-Identifier: BSD-3-Clause
"""The frames of a robot's links as messages of /tf, from the positions of its joints. ROS-free."""
from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Robot
from urdf_model.transforms import quaternion_from_matrix

if TYPE_CHECKING:
    from urdf_model.model import Joint

_HEAD = "I"  # number of transforms, or length of a text
_STAMPED = "III"  # sequence, seconds, nanoseconds
_POSE = "7d"  # translation, quaternion x y z w
# Sets of joints that are remembered: a robot has few, and a publisher of other names in each message must not fill the
# memory.
_MAX_SETS = 8
# States of several publishers may arrive out of order; an older one than that is of a clock that was reset [ns].
_DISORDER_NS = 100_000_000


def tf_name(prefix: str, frame: str) -> str:
    """The name of a frame in tf, as tf::resolve gives it; a frame with a leading slash takes no prefix."""
    return frame[1:] if frame.startswith("/") else "/".join(part for part in (prefix.lstrip("/"), frame) if part)


class JointFrames:
    """Makes the bytes of a tf2_msgs/TFMessage. ``prefix``: tf_prefix of its frames."""

    def __init__(self, robot: Robot, prefix: str = "") -> None:
        self._joints = {joint.name: joint for joint in robot.movable_joints()}
        # A planar joint counts as fixed, as in the original; only a pose could move a floating one.
        self._fixed = sorted((joint for joint in robot.joints.values() if joint.type in ("fixed", "planar")),
                             key=lambda joint: joint.name)
        self._of_robot = robot.joints.keys()
        self._prefix = prefix
        self._groups = {}

    def moving(self, names: Sequence[str], positions: Sequence[float], time_ns: int) -> bytes:
        """The transforms of the joints ``names`` (k,) at ``positions`` (k,) [rad, m], and of those that mimic them, at
        a time [ns], in the order of joint names. Unknown names are left out, and a repeated name's first position
        counts."""
        names = tuple(names)
        group = self._groups.get(names)
        if group is None:
            group = _remembered(self._groups, names, self._group(names))
        return group.packed(np.asarray(positions, dtype=float), time_ns)

    def fixed(self, time_ns: int) -> bytes:
        """The transforms of all fixed joints."""
        return _Group([(joint, 0, 0.0, 0.0) for joint in self._fixed], self._prefix).packed(np.zeros(1), time_ns)

    def known(self, names: Iterable[str]) -> list[str]:
        """Those of the names that move a link."""
        return [name for name in names if name in self._joints]

    def unknown(self, names: Iterable[str]) -> list[str]:
        """Those of the names that the description does not have."""
        return [name for name in names if name not in self._of_robot]

    def _group(self, names: tuple[str, ...]) -> _Group:
        rows = {}  # {joint: (place of its position in the message, multiplier, offset)}
        for place, name in enumerate(names):
            rows.setdefault(name, (place, 1.0, 0.0))
        for name, joint in sorted(self._joints.items()):
            if joint.mimic is not None and joint.mimic.joint in rows:
                place, scale, offset = rows[joint.mimic.joint]
                factor = joint.mimic.multiplier
                rows.setdefault(name, (place, scale * factor, offset * factor + joint.mimic.offset))
        return _Group([(self._joints[name], *rows[name]) for name in sorted(self.known(rows))], self._prefix)


class _Group:
    """Joints that are computed at once. rows: of (joint, place of its position in a message, multiplier, offset)."""

    def __init__(self, rows: list[tuple[Joint, int, float, float]], prefix: str) -> None:
        joints = [joint for joint, _, _, _ in rows]
        self._place = np.array([place for _, place, _, _ in rows], dtype=int)
        self._scale, self._offset = (np.array([row[column] for row in rows]) for column in (2, 3))
        slides = np.array([joint.type == "prismatic" for joint in joints], dtype=bool)
        self._half = np.where(slides, 0.0, 0.5)
        axes = np.array([joint.axis for joint in joints]).reshape(-1, 3)
        rotations = np.array([joint.origin[:3, :3] for joint in joints]).reshape(-1, 3, 3)
        self._start = np.array([joint.origin[:3, 3] for joint in joints]).reshape(-1, 3)
        self._along = np.einsum("nij,nj->ni", rotations, axes) * slides[:, None]
        # The quaternion of the origin times (axis sin, cos) is this times cos, and that times sin.
        self._at_rest = np.array([quaternion_from_matrix(rotation) for rotation in rotations]).reshape(-1, 4)
        w, v = self._at_rest[:, 3:], self._at_rest[:, :3]
        self._turned = np.hstack([w * axes + np.cross(v, axes), -(v * axes).sum(axis=1, keepdims=True)])
        self._each = np.arange(len(joints))
        texts = [(tf_name(prefix, joint.parent).encode(), tf_name(prefix, joint.child).encode()) for joint in joints]
        self._layout = struct.Struct("<" + _HEAD + "".join(
            "%s%s%ds%s%ds%s" % (_STAMPED, _HEAD, len(parent), _HEAD, len(child), _POSE) for parent, child in texts))
        self._texts = [(len(parent), parent, len(child), child) for parent, child in texts]

    def packed(self, positions: np.ndarray, time_ns: int) -> bytes:
        values = positions[self._place] * self._scale + self._offset
        angle = values * self._half
        turn = self._at_rest * np.cos(angle)[:, None] + self._turned * np.sin(angle)[:, None]
        # Of the two quaternions of a rotation, the one of the original: w above a half, or else the largest part above
        # zero.
        leading = np.where(np.abs(turn[:, 3]) > 0.5, 3, np.abs(turn[:, :3]).argmax(axis=1))
        turn *= np.copysign(1.0, turn[self._each, leading])[:, None]
        poses = np.hstack([self._start + self._along * values[:, None], turn]).tolist()
        stamp = (0, *divmod(time_ns, 10**9))
        fields: list[int | float | bytes] = [len(poses)]
        for texts, pose in zip(self._texts, poses, strict=True):
            fields += stamp
            fields += texts
            fields += pose
        return self._layout.pack(*fields)


class Due:
    """Which joint states are sent on: where one of their joints was sent at least ``period_ns`` [ns] before."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._last_ns = {}

    def __call__(self, names: Iterable[str], time_ns: int) -> bool:
        """Whether the state of the joints ``names`` of the robot at this time [ns] is due. Time may have gone back."""
        last_ns = min((self._last_ns.get(name, 0) for name in names), default=time_ns)
        if last_ns > time_ns + _DISORDER_NS:
            self.forget()
            last_ns = 0
        if time_ns < last_ns + self._period_ns:
            return False
        self._last_ns.update(dict.fromkeys(names, time_ns))
        return True

    def forget(self) -> None:
        """The next state of any joints is due."""
        self._last_ns.clear()


def _remembered(table: dict[tuple[str, ...], _Group], names: tuple[str, ...], value: _Group) -> _Group:
    if names not in table and len(table) >= _MAX_SETS:
        table.clear()
    table[names] = value
    return value
