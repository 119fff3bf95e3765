# SPDX-License-Identifier: BSD-3-Clause
"""A serial chain of joints from a base link to a tip link: poses of its links, and their motion with the joints."""
from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import kernels
from arm_kinematics.errors import ChainError, InvalidPosture
from command_line.options import counted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from urdf_model import Robot

    #: Of a URDF joint: name, type, child link, origin (4, 4), axis (3,), lower and upper limit [rad or m].
    Step = tuple[str, str, str, ArrayLike, ArrayLike, float | None, float | None]

_MOVABLE = ("revolute", "continuous", "prismatic")


class Chain:
    """The n moving joints between ``base`` and ``tip``.

    Joint values are arrays (n,) in chain order, base to tip [rad, or m for a prismatic joint]. Poses are (4, 4), in the
    base link's frame [m]. A chain never changes and may be used from any number of threads.

    base, tip: link names. joint_names: tuple of n. lower, upper: (n,) limits, infinite where there is none.
    link_names: every link of the chain, base first, including fixed ones.
    """

    def __init__(self, base: str, tip: str, steps: Iterable[Step]) -> None:
        """``steps``: (name, type, child link, origin (4, 4), axis (3,), lower, upper) per URDF joint, base to tip.

        Raises ChainError for an unsupported joint type, a zero axis, or limits in the wrong order.
        """
        self.base, self.tip = base, tip
        names, lower, upper, prismatic, rotations, offsets = [], [], [], [], [], []
        link_names, hangs_on = [base], [(-1, np.eye(4))]
        # The frame of the last moved joint is turned so that its axis is z; ``pending`` is the transform from there to
        # the link.
        pending = np.eye(4)
        for name, kind, child, origin, axis, low, high in steps:
            pending = pending @ np.asarray(origin, dtype=float)
            if kind in _MOVABLE:
                turn = np.eye(4)
                turn[:3, :3] = _rotation_taking_z_to(axis, name)
                entry = pending @ turn
                rotations.append(entry[:3, :3])
                offsets.append(entry[:3, 3])
                pending = turn.T
                low = -math.inf if low is None or kind == "continuous" else float(low)
                high = math.inf if high is None or kind == "continuous" else float(high)
                if not low <= high:
                    raise ChainError("joint '%s' has lower limit %g above its upper limit %g" % (name, low, high))
                names.append(name)
                lower.append(low)
                upper.append(high)
                prismatic.append(kind == "prismatic")
            elif kind != "fixed":
                raise ChainError("joint '%s' between '%s' and '%s' is %s; a chain is made of revolute, continuous, "
                                 "prismatic and fixed joints" % (name, base, tip, kind))
            link_names.append(child)
            hangs_on.append((len(names) - 1, pending))
        rotations.append(pending[:3, :3])
        offsets.append(pending[:3, 3])
        if not names:
            raise ChainError("no joint moves between '%s' and '%s'" % (base, tip))
        self.joint_names = tuple(names)
        self.link_names = tuple(link_names)
        self._hangs_on = tuple(hangs_on)
        # Contiguous and writable: another memory layout would make numba compile everything a second time.
        self.arrays = (np.array(rotations), np.array(offsets), np.array(prismatic, dtype=bool))
        self.limit_arrays = (np.array(lower), np.array(upper))
        self._set_reach()
        self.lower, self.upper = (_read_only(limit) for limit in self.limit_arrays)

    @classmethod
    def from_robot(cls, robot: Robot, base: str = "base", tip: str = "left_gripper") -> Chain:
        """Return the chain between two links of an ``urdf_model.Robot``.

        Raises ChainError, or ``urdf_model.UrdfError`` where a link is unknown or ``tip`` does not hang below ``base``.
        """
        steps = []
        for joint in robot.chain(base, tip):
            if joint.mimic is not None:
                raise ChainError("joint '%s' between '%s' and '%s' mimics another; it cannot be moved on its own"
                                 % (joint.name, base, tip))
            steps.append((joint.name, joint.type, joint.child, joint.origin, joint.axis, joint.limit.lower,
                          joint.limit.upper))
        return cls(base, tip, steps)

    def _set_reach(self) -> None:
        """Compute two balls around the first joint, by the sum of the links' lengths: the tip and the origin of the
        last joint never leave them.

        A pose of the tip determines that origin if the last joint is revolute: it lies at ``wrist_in_tip`` (3,) in the
        tip's frame.
        """
        rotations, offsets, prismatic = self.arrays
        stroke = np.where(prismatic, np.maximum(np.abs(self.limit_arrays[0]), np.abs(self.limit_arrays[1])), 0.0)
        lengths = np.linalg.norm(offsets[1:], axis=1) + stroke
        self.shoulder = offsets[0]
        self.tip_reach_m = float(lengths.sum())
        self.wrist_reach_m = float(lengths[:-1].sum())
        self.wrist_is_fixed = not prismatic[-1]
        self.wrist_in_tip = rotations[-1].T @ offsets[-1]

    def __len__(self) -> int:
        return len(self.joint_names)

    def __repr__(self) -> str:
        return "Chain('%s' to '%s': %s)" % (self.base, self.tip, ", ".join(self.joint_names))

    @property
    def mid_range(self) -> np.ndarray:
        """The posture (n,) in the middle of the limits; 0 where a joint has none."""
        finite = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = np.zeros(len(self))
        middle[finite] = 0.5 * (self.lower[finite] + self.upper[finite])
        return np.clip(middle, self.lower, self.upper)

    def posture(self, values: ArrayLike) -> np.ndarray:
        """Return ``values`` as a new array (n,). Raises InvalidPosture for a wrong count, or a value that is not
        finite."""
        try:
            q = np.array(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidPosture("joint values must be %s, got %r" % (counted(len(self), "number"), values),
                                 values) from None
        if q.shape != (len(self),):
            raise InvalidPosture("expected %s (%s), got an array of shape %s"
                                 % (counted(len(self), "joint value"), ", ".join(self.joint_names), q.shape), values)
        # The sum of the squares is finite unless a value is not, or is impossibly large.
        if not math.isfinite(q.dot(q)) and not all(map(math.isfinite, q.tolist())):
            bad = ["%s = %s" % pair for pair in zip(self.joint_names, q, strict=True) if not math.isfinite(pair[1])]
            raise InvalidPosture("joint values must be finite, got %s" % ", ".join(bad), values)
        return q

    def posture_by_name(self, names: Sequence[str], positions: Sequence[float]) -> np.ndarray:
        """Return the posture (n,) picked out of parallel lists of joint names and positions; other joints may be in the
        lists.

        Raises InvalidPosture when the lists differ in length, or a joint of the chain is missing, repeated, not finite.
        """
        if len(names) != len(positions):
            raise InvalidPosture("%s but %s" % (counted(len(names), "joint name"),
                                                counted(len(positions), "position")), positions)
        missing = [name for name in self.joint_names if name not in names]
        if missing:
            raise InvalidPosture("no value for %s; expected the joints %s, got %s"
                                 % (", ".join(missing), ", ".join(self.joint_names), ", ".join(names) or "none"), names)
        repeated = [name for name in self.joint_names if names.count(name) > 1]
        if repeated:
            raise InvalidPosture("more than one value for %s" % ", ".join(repeated), names)
        return self.posture([positions[names.index(name)] for name in self.joint_names])

    def fk(self, q: ArrayLike) -> np.ndarray:
        """Return the tip's pose (4, 4) in the base frame. Raises InvalidPosture."""
        return self.fk_and_jacobian(q)[0]

    def jacobian(self, q: ArrayLike) -> np.ndarray:
        """Return the tip's geometric Jacobian (6, n): J @ q_dot is its velocity [m/s], then angular velocity [rad/s].

        Both in the base frame, the velocity that of the tip's origin. Raises InvalidPosture.
        """
        return self.fk_and_jacobian(q)[1]

    def fk_and_jacobian(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return (:meth:`fk`, :meth:`jacobian`) for little more than the cost of one. Raises InvalidPosture."""
        return kernels.tip_and_jacobian(*self.arrays, self.posture(q))

    def joint_frames(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the rotations (n + 1, 3, 3) and origins (n + 1, 3) of every joint's moved frame, whose z is its axis,
        and of the tip, in the base frame. Raises InvalidPosture."""
        return kernels.joint_frames(*self.arrays, self.posture(q))

    def link_frames(self, q: ArrayLike) -> dict[str, np.ndarray]:
        """Return {link name: pose (4, 4) in the base frame} for every link of the chain. Raises InvalidPosture."""
        rotations, origins = self.joint_frames(q)
        frames = {}
        for link, (joint, offset) in zip(self.link_names, self._hangs_on, strict=True):
            frame = np.eye(4)
            if joint >= 0:
                frame[:3, :3], frame[:3, 3] = rotations[joint], origins[joint]
            frames[link] = frame @ offset
        return frames


def wrench_from_torques(jacobian: ArrayLike, torques: ArrayLike, damping: float = 0.01) -> np.ndarray:
    """Return the wrench (6,), force [N] then torque [Nm], that the joint torques (n,) [Nm or N] exert through the tip.

    Base frame, about the tip's origin. The least-squares solution of ``J^T w = torques``, damped (``damping`` in the
    unit of the Jacobian) so that a direction in which the arm is nearly singular gives a small wrench, not a huge one.
    Subtract torques that balance gravity or accelerate the arm first.
    """
    jacobian = np.array(jacobian, dtype=np.float64)
    torques = np.array(torques, dtype=np.float64)
    if jacobian.ndim != 2 or jacobian.shape[0] != 6 or torques.shape != (jacobian.shape[1],):
        raise InvalidPosture("expected a Jacobian (6, n) and n torques, got %s and %s"
                             % (jacobian.shape, torques.shape), torques)
    return kernels.wrench(jacobian, torques, float(damping))


def _rotation_taking_z_to(axis: ArrayLike, joint_name: str) -> np.ndarray:
    """The shortest rotation (3, 3) that turns the z axis into ``axis``."""
    axis = np.asarray(axis, dtype=float)
    length = float(np.linalg.norm(axis))
    if not math.isfinite(length) or length < 1e-9:
        raise ChainError("joint '%s' has axis %s, which is not a direction" % (joint_name, axis))
    x, y, z = axis / length
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    k = 1.0 / (1.0 + z)
    return np.array([[1.0 - k * x * x, -k * x * y, x], [-k * x * y, 1.0 - k * y * y, y], [-x, -y, z]])


def _read_only(array: np.ndarray) -> np.ndarray:
    view = array.view()
    view.flags.writeable = False
    return view
