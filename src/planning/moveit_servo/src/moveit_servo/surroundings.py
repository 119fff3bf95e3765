# SPDX-License-Identifier: BSD-3-Clause
"""The objects that an arm may run into: its scene as tables, and the bounds on joint velocities that keep it clear."""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.spheres import kernel
from motion_planning.spheres.tables import bake
from moveit_servo import gaps

if TYPE_CHECKING:
    from motion_planning.model import Group, PlanningModel
    from motion_planning.scene import Scene
    from motion_planning.spheres import SphereModel

# Number of gaps that are looked at in one step.
_MAX_GAPS = 64


class Near(NamedTuple):
    """Gaps that are small at one posture.

    distance (m,) [m]: between spheres, which reach a little beyond the bodies; below 0 where they overlap.
    slope (m, k) [m per rad or m]: change of each with the arm's own joints. drift (m,) [m/s]: their change by the other
    joints. of_robot (m,) bool: whether the other body is a moving part of the robot. closed: whether links that spheres
    cannot tell apart may touch.
    """

    distance: np.ndarray
    slope: np.ndarray
    drift: np.ndarray
    of_robot: np.ndarray
    closed: bool


class Surroundings:
    """A scene prepared for one arm: objects, held ones, the octomap, and the whole robot as it moves. Immutable.

    Every joint of the robot is a variable, so that another arm's motion needs no new preparation.
    """

    def __init__(self, sphere_model: SphereModel, group: Group, scene: Scene) -> None:
        """Prepare ``scene`` for the arm of ``group``; takes up to seconds for a new scene."""
        model = sphere_model.model
        self.indices = np.array(group.indices, np.int64)
        tables, self.remarks = bake(sphere_model, whole_robot(model, group), scene, scene.state)
        self._tables = tables
        robot = tables[0]
        own = _moved_by(robot, self.indices)
        clusters = robot[2].reshape(-1, kernel.CLUSTER)
        mine = own[clusters[:, 0]]
        pairs, tests = robot[5].reshape(-1, 2), robot[6].reshape(-1, 3)
        pairs = pairs[mine[pairs].any(axis=1)]
        # The arm's own body comes first: its joints change the point of the gap.
        pairs = np.where(mine[pairs[:, :1]], pairs, pairs[:, ::-1])
        self._checks = (np.ascontiguousarray(pairs, np.int64).reshape(-1, 2),
                        np.ascontiguousarray(tests[mine[tests[:, 0]]], np.int64).reshape(-1, 3))
        self._most = _MAX_GAPS

    def near(self, q: np.ndarray, velocity: np.ndarray, reach: float) -> Near:
        """Return the gaps below ``reach`` [m] at ``q`` (n,), all joints of the model, of which the others than the
        arm's move at ``velocity`` (n,) [per s]."""
        return Near(*gaps.around(self._tables, self._checks, q, velocity, self.indices, reach, self._most))

    def closed(self, q: np.ndarray) -> bool:
        """Whether links that spheres cannot tell apart may touch at ``q`` (n,)."""
        return bool(gaps.closed_cell(self._tables[0], q))


def whole_robot(model: PlanningModel, group: Group) -> Group:
    """Return a Group of all joints of the robot, like ``group`` elsewhere."""
    moving = tuple(link for link in model.links if any(
        joint.movable for joint in model.robot.chain(model.root, link)))
    return replace(group, name="(all joints)", joints=model.variables, indices=np.arange(len(model.variables)),
                   moving_links=moving)


def _moved_by(robot: tuple, indices: np.ndarray) -> np.ndarray:
    """(j,) bool: whether the joints of the tables, or one before them, are among the variables ``indices``."""
    joints = robot[0].reshape(-1, kernel.JOINT)
    moved = np.isin(joints[:, 2], indices)
    for number, (parent, *_) in enumerate(joints):
        moved[number] |= parent >= 0 and moved[parent]
    return moved
