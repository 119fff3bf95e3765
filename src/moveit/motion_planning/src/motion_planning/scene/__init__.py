# SPDX-License-Identifier: BSD-3-Clause
"""What stands around the robot, what it holds, and which of all that may touch. A snapshot: changes make new scenes."""
from motion_planning.scene.allowed import AllowedCollisions
from motion_planning.scene.objects import OCTOMAP, AttachedBody, SceneError, WorldObject
from motion_planning.scene.scene import Scene, check_object
from motion_planning.shapes import Cone, Octree, TriangleMesh

__all__ = ["OCTOMAP", "AllowedCollisions", "AttachedBody", "Cone", "Octree", "Scene", "SceneError", "TriangleMesh",
           "WorldObject", "check_object"]
