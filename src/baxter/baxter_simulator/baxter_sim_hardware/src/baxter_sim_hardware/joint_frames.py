# SPDX-License-Identifier: BSD-3-Clause
"""The frames of a robot's links as messages of /tf, from the positions of its joints. ROS-free."""
import struct

import numpy as np

from urdf_model.transforms import quaternion_from_matrix

_HEAD = "I"  # number of transforms, or length of a text
_STAMPED = "III"  # sequence, seconds, nanoseconds
_POSE = "7d"  # translation, quaternion x y z w
# Sets of joints that are remembered: a robot has few, and who sends other names in each message must not fill the
# memory.
_MOST_SETS = 8


class JointFrames:
    """Makes the bytes of a tf2_msgs/TFMessage. ``robot``: urdf_model.Robot."""

    def __init__(self, robot):
        self._joints = {joint.name: joint for joint in robot.movable_joints()}
        self._followers = {}  # {name: joints that mimic it}
        for joint in self._joints.values():
            if joint.mimic is not None:
                self._followers.setdefault(joint.mimic.joint, []).append(joint)
        self._fixed = [joint for joint in robot.joints.values() if joint.type == "fixed"]
        self._groups = {}

    def moving(self, names, positions, time_ns):
        """The transforms of the joints ``names`` (k,) at ``positions`` (k,) [rad, m], and of those that mimic them, at
        a time [ns]; unknown names are left out."""
        names = tuple(names)
        group = self._groups.get(names)
        if group is None:
            group = _remembered(self._groups, names, self._group(names))
        return group.packed(np.asarray(positions, dtype=float), time_ns)

    def fixed(self, time_ns):
        """The transforms of all fixed joints."""
        return _Group([(joint, 0, 0.0, 0.0) for joint in self._fixed]).packed(np.zeros(1), time_ns)

    def _group(self, names):
        rows = []
        for place, name in enumerate(names):
            if name in self._joints:
                rows.append((self._joints[name], place, 1.0, 0.0))
            rows += [(joint, place, joint.mimic.multiplier, joint.mimic.offset)
                     for joint in self._followers.get(name, ()) if joint.name not in names]
        return _Group(rows)


class _Group:
    """Joints that are computed at once. rows: of (joint, place of its position in a message, multiplier, offset)."""

    def __init__(self, rows):
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
        texts = [(joint.parent.encode(), joint.child.encode()) for joint in joints]
        self._layout = struct.Struct("<" + _HEAD + "".join(
            "%s%s%ds%s%ds%s" % (_STAMPED, _HEAD, len(parent), _HEAD, len(child), _POSE) for parent, child in texts))
        self._texts = [(len(parent), parent, len(child), child) for parent, child in texts]

    def packed(self, positions, time_ns):
        values = positions[self._place] * self._scale + self._offset
        angle = values * self._half
        poses = np.hstack([self._start + self._along * values[:, None],
                           self._at_rest * np.cos(angle)[:, None] + self._turned * np.sin(angle)[:, None]]).tolist()
        stamp = (0, *divmod(time_ns, 10**9))
        fields = [len(poses)]
        for texts, pose in zip(self._texts, poses, strict=True):
            fields += stamp
            fields += texts
            fields += pose
        return self._layout.pack(*fields)


class Due:
    """Which joint states are sent on, at ``period_ns`` [ns] at least from the last one of the same joints: the fingers
    may come in a message of their own."""

    def __init__(self, period_ns):
        self._period_ns = period_ns
        self._last_ns = {}

    def __call__(self, names, time_ns):
        """Whether the state of the joints ``names`` at this time [ns] is due. Time may have gone back."""
        names = tuple(names)
        last_ns = self._last_ns.get(names)
        if last_ns is not None and last_ns <= time_ns < last_ns + self._period_ns:
            return False
        _remembered(self._last_ns, names, time_ns)
        return True

    def forget(self):
        """The next state of any joints is due."""
        self._last_ns.clear()


def _remembered(table, names, value):
    if names not in table and len(table) >= _MOST_SETS:
        table.clear()
    table[names] = value
    return value
