# SPDX-License-Identifier: BSD-3-Clause
"""Joints whose commands of several controllers add up, and the efforts that carry a chain of links. ROS-free."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from controller_manager.hardware import RobotHardware
from controller_manager.interfaces import COMMAND, EFFORT, POSITION, VELOCITY

if TYPE_CHECKING:
    from bullet_sim import Model
    from urdf_model import Joint, Robot

GRAVITY_M_S2 = 9.81  # as robot_controllers' gravity compensation has it, whatever the world's


class CascadeHardware(RobotHardware):
    """All joints of a ``bullet_sim.Model``; commands count for one step and are cleared before the next.

    A joint with a position command moves with a velocity of gain times the error plus the commanded velocity, at most
    the joint's limit and, from the error, never beyond the command; with only a velocity command it moves with that.
    Both are kept by a motor with at most ``largest_effort``. With neither, the commanded effort acts.

    ``command[POSITION]`` and ``command[VELOCITY]`` are NaN where there is no command. ``largest_effort`` (n,) [Nm, N]:
    from the description; controllers may lower it for a step.
    """

    def __init__(self, model: Model, robot: Robot, gains: npt.ArrayLike) -> None:
        """``gains`` (n,): velocity per position error [1/s], in the order of ``model.joint_names``."""
        super().__init__(dict.fromkeys(model.joint_names, COMMAND))
        joints = [robot.joints[name] for name in self.joint_names]
        self._model = model
        self._every = model.index(self.joint_names)
        self._gains = np.asarray(gains, dtype=float)
        self._continuous = np.array([joint.type == "continuous" for joint in joints], dtype=bool)
        self._effort_limit = np.array([_bound(joint.limit.effort, 1e9) for joint in joints])
        self.velocity_limit = np.array([_bound(joint.limit.velocity, math.inf) for joint in joints])
        self.largest_effort = self._effort_limit.copy()
        self.read()
        self.clear()

    def read(self) -> None:
        """Take the model's joint state, as it is after the last physics step."""
        for ours, theirs in zip((self.position, self.velocity, self.effort), self._model.read_joints(), strict=True):
            ours[:] = theirs[self._every]

    def clear(self) -> None:
        """Drop all commands."""
        self.command[POSITION][:] = math.nan
        self.command[VELOCITY][:] = math.nan
        self.command[EFFORT][:] = 0.0
        self.largest_effort[:] = self._effort_limit

    def write(self, dt: float) -> None:
        """Drive the model's joints for the next physics step of ``dt`` seconds."""
        position, velocity = self.command[POSITION], self.command[VELOCITY]
        placed, fed = ~np.isnan(position), ~np.isnan(velocity)
        wanted = np.where(fed, velocity, 0.0)
        if placed.any():
            error = np.where(placed, position - self.position, 0.0)
            error = np.where(self._continuous, np.remainder(error + math.pi, 2.0 * math.pi) - math.pi, error)
            towards = np.minimum(self._gains, 1.0 / dt) * error
            cascade = np.clip(wanted + towards, -self.velocity_limit, self.velocity_limit)
            wanted = np.where(placed, cascade, wanted)
        driven = placed | fed
        if driven.any():
            self._model.drive_velocity(self._every[driven], wanted[driven], self.largest_effort[driven])
        if not driven.all():
            limit = self._effort_limit[~driven]
            self._model.drive_effort(self._every[~driven], np.clip(self.command[EFFORT][~driven], -limit, limit))

    def hold_all(self) -> None:
        """Keep all joints where they are."""
        self._model.drive_velocity(self._every, np.zeros(len(self._every)), self._effort_limit)


class CarriedChain:
    """The links between ``root`` and ``tip`` of a ``urdf_model.Robot``, and the efforts that bear their weight.

    The root is taken as upright. Links beside the chain do not count. Raises KeyError if ``tip`` is no link of the
    robot or is not behind ``root``.
    """

    def __init__(self, robot: Robot, root: str, tip: str) -> None:
        chain = []
        while tip != root:
            joint = robot.parent_joint(robot.links[tip].name)
            if joint is None:
                raise KeyError(root)
            chain.insert(0, joint)
            tip = joint.parent
        self._chain = chain
        self._inertials = [robot.links[joint.child].inertial for joint in chain]
        #: Names of the joints that move, from the root on.
        self.joints = [joint.name for joint in chain if joint.movable]

    def efforts(self, position: Sequence[float] | np.ndarray) -> np.ndarray:
        """(k,) efforts [Nm, N] that hold the chain at ``position`` (k,), both in the order of ``joints``.

        By virtual work: the force m g on each link behind a joint, times the way of its centre of mass per unit of the
        joint's motion.
        """
        frame, moved, weights = np.eye(4), 0, []
        origins, axes, sliding = [], [], []
        for joint, inertial in zip(self._chain, self._inertials, strict=True):
            frame = frame @ joint.origin
            if joint.movable:
                origins.append(frame[:3, 3].copy())
                axes.append(frame[:3, :3] @ joint.axis)
                sliding.append(joint.type == "prismatic")
                frame = frame @ motion(joint, position[moved])
                moved += 1
            frame = frame @ joint.child_offset
            if inertial is not None:
                weights.append((moved, frame[:3, :3] @ inertial.centre + frame[:3, 3], inertial.mass * GRAVITY_M_S2))
        efforts = np.zeros(moved)
        for behind, centre, weight in weights:
            for i in range(behind):
                way = axes[i] if sliding[i] else np.cross(axes[i], centre - origins[i])
                efforts[i] += weight * way[2]
        return efforts


def motion(joint: Joint, amount: float) -> np.ndarray:
    """Matrix (4, 4) of a joint moved by ``amount`` [rad, m]; rotation by Rodrigues' formula."""
    moved = np.eye(4)
    if joint.type == "prismatic":
        moved[:3, 3] = joint.axis * amount
        return moved
    x, y, z = joint.axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    moved[:3, :3] += math.sin(amount) * cross + (1.0 - math.cos(amount)) * cross @ cross
    return moved


def _bound(limit, absent):
    return absent if limit is None else min(limit, absent)
