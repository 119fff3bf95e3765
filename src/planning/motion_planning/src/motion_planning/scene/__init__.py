# SPDX-License-Identifier: BSD-3-Clause
"""The objects around the robot, attached objects, and allowed collisions. A snapshot: changes return new scenes."""
from motion_planning.scene.allowed import AllowedCollisions
from motion_planning.scene.objects import OCTOMAP, AttachedBody, SceneError, WorldObject
from motion_planning.scene.scene import Scene, check_object, like
from motion_planning.shapes import Cone, Octree, TriangleMesh

__all__ = ["OCTOMAP", "AllowedCollisions", "AttachedBody", "Cone", "Octree", "Scene", "SceneError", "TriangleMesh",
           "WorldObject", "check_object", "like"]
