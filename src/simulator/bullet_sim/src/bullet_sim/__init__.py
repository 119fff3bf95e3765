# SPDX-License-Identifier: BSD-3-Clause
"""A PyBullet world of URDF robots: spawn, step, read joints, drive joints. Knows no ROS.

One thread owns a World and all its Models; nothing here locks.
"""

from .contact import ContactPoint
from .errors import LOG, BulletSimError
from .model import Model
from .pose import Pose
from .shapes import MeshCache, MeshFiles
from .stand_ins import with_stand_ins
from .world import World

__all__ = ["LOG", "BulletSimError", "ContactPoint", "MeshCache", "MeshFiles", "Model", "Pose", "World",
           "with_stand_ins"]
