# SPDX-License-Identifier: BSD-3-Clause
"""Poses of an object on a surface."""
from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.scene import SceneError
from motion_planning.shapes import Octree, TriangleMesh
from urdf_model import Box, Plane
from urdf_model.transforms import axis_rotation, rigid

if TYPE_CHECKING:
    from motion_planning.scene import Scene, WorldObject
    from motion_planning.shapes import Geometry

# Distance of spots from each other and from the surface's edge [m]; number of rotations of the object about the
# vertical at each spot.
_SPACING_M, _TURNS = 0.08, 4
# Height above the surface from which an object is put down [m].
_CLEARANCE_M = 0.001
_MOST = 200


def places_on(scene: Scene, support: str, thing: WorldObject) -> list[np.ndarray]:
    """Return poses (4, 4) at which an object stands on a box of the scene, sorted by the distance from its present
    pose.

    support: id of an object whose first shape is a box with a horizontal upper face. thing: WorldObject at its present
    pose, whose tilt is kept. Raises SceneError.
    """
    surface, object_pose, height = scene.objects.get(support), thing.pose, thing.pose[2, 3] - lowest(thing)
    shape, inside = surface.shapes[0] if surface is not None else (None, np.eye(4))
    if surface is None or not isinstance(shape, Box):
        raise SceneError("places can be thought of on a box alone; '%s' is %s" % (
            support, "not in the scene" if surface is None else "none"))
    pose = surface.pose @ inside
    up = int(np.abs(pose[2, :3]).argmax())
    if abs(pose[2, up]) < 0.999:
        raise SceneError("nothing stands on '%s': no face of it looks up" % support)
    flat = [axis for axis in range(3) if axis != up]
    top = pose[2, 3] + 0.5 * shape.size[up] + height + _CLEARANCE_M
    steps = [_steps(shape.size[axis]) for axis in flat]
    found = []
    for a, b in itertools.product(*steps):
        spot = pose[:3, 3] + a * pose[:3, flat[0]] + b * pose[:3, flat[1]]
        found.append((spot[0], spot[1], top))
    found.sort(key=lambda spot: math.dist(spot[:2], object_pose[:2, 3]))
    turns = [axis_rotation(np.array([0.0, 0.0, 1.0]), turn * 2.0 * math.pi / _TURNS) for turn in range(_TURNS)]
    return [rigid(turn @ object_pose[:3, :3], np.array(spot))
            for spot, turn in itertools.islice(itertools.product(found, turns), _MOST)]


def lowest(thing: WorldObject) -> float:
    """Return the height [m] of the lowest point of a WorldObject in the planning frame."""
    return min(_lowest(shape, thing.pose @ pose) for shape, pose in thing.shapes)


def _lowest(shape: Geometry, pose: np.ndarray) -> float:
    height, up = pose[2, 3], pose[2, :3]
    if isinstance(shape, Box):
        return height - 0.5 * float(np.abs(up) @ shape.size)
    if isinstance(shape, TriangleMesh):
        return height + float((shape.vertices @ up).min())
    if isinstance(shape, Plane | Octree):
        raise SceneError("a %s has no lowest point to stand on" % type(shape).__name__.lower())
    # Bounded by a ball, or by the cylinder around it.
    return height - 0.5 * abs(up[2]) * getattr(shape, "length", 2.0 * shape.radius) - math.hypot(*up[:2]) * shape.radius


def _steps(size: float) -> np.ndarray:
    reach = max(0.0, 0.5 * size - _SPACING_M)
    count = int(reach / _SPACING_M)
    return np.arange(-count, count + 1) * _SPACING_M
