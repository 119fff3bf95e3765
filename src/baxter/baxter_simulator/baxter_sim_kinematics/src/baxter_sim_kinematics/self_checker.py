# SPDX-License-Identifier: BSD-3-Clause
"""Whether a robot touches itself. Imported only where it is used: importing PyBullet is slow."""
from __future__ import annotations

from collections.abc import Callable

from arm_kinematics.bullet_checker import BulletChecker
from baxter_model.self_collision import MESH_CUTS, self_collision_pairs
from bullet_sim import LOG
from urdf_model import Robot


def self_checker(robot: Robot, find_mesh: Callable[[str], str | None],
                 warn: Callable[[str], None] = LOG.warning) -> BulletChecker:
    """Return a BulletChecker of a robot alone: with Baxter's own pairs and convex pieces, or of another robot with all
    pairs that make sense. ``find_mesh``, ``warn``: as for ``bullet_sim.World``.
    """
    pairs = self_collision_pairs(robot.links)
    if not pairs:
        return BulletChecker.of_robot(robot, find_mesh=find_mesh, warn=warn)
    return BulletChecker.of_robot(robot, pairs, find_mesh=find_mesh, mesh_cuts=MESH_CUTS, warn=warn)
