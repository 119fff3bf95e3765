# SPDX-License-Identifier: BSD-3-Clause
"""Bodies that are known already and must not enter the map: the robot, attached objects, objects of the scene."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.exact.geometry import bounds_of
from motion_planning.occupancy import kernels
from motion_planning.shapes import Octree
from motion_planning.spheres.cover import CoverError
from motion_planning.spheres.sphere_model import Boxes
from urdf_model import Cylinder, Plane, Sphere

if TYPE_CHECKING:
    from motion_planning.scene import Scene
    from motion_planning.shapes import Geometry
    from motion_planning.spheres import SphereModel


class Mask:
    """Points of a cloud that belong to a scene's robot or to its objects.

    arrays: the input of ``kernels``; in the planning frame.
    """

    def __init__(self, scene: Scene, spheres: SphereModel, padding: float = 0.0, scale: float = 1.0) -> None:
        """scene: Scene with the robot's state at the time of the cloud; spheres: SphereModel of the robot.

        padding [m], scale: by how much solids are larger than their bodies; the robot's are another centimetre larger
        because of its spheres. Meshes of objects count as boxes around them; planes and octrees are ignored.
        """
        model, state = scene.model, scene.state
        frames = model.frames(state.q, state.base)
        groups = [_links_balls(spheres, link, frames[model.link_index[link]]) for link in model.links]
        bodies = [(body.object, frames[model.link_index[body.link]]) for body in state.attached.values()]
        for thing, frame in [*bodies, *((thing, np.eye(4)) for thing in scene.objects.values())]:
            groups += [_solid(shape, frame @ thing.pose @ pose) for shape, pose in thing.shapes
                       if not isinstance(shape, Plane | Octree)]
        groups = [group for group in groups if len(group)]
        for group in groups:
            group[:, 12:15] = group[:, 12:15] * scale + padding
        balls = np.array([_around(group) for group in groups]).reshape(-1, 4)
        starts = np.cumsum([0, *map(len, groups)], dtype=np.int64)
        solids = np.concatenate(groups) if groups else np.empty((0, 16))
        self.arrays = np.ascontiguousarray(balls), starts, np.ascontiguousarray(solids)


def _links_balls(spheres: SphereModel, link: str, frame: np.ndarray) -> np.ndarray:
    try:
        found = spheres.spheres(link)
    except CoverError:  # too large for spheres, such as a table that is part of the robot
        return _links_solids(spheres, link, frame)
    solids = np.zeros((len(found), 16))
    solids[:, :3] = found[:, :3] @ frame[:3, :3].T + frame[:3, 3]
    solids[:, 12:15], solids[:, 15] = found[:, 3:], kernels.BALL
    return solids


def _links_solids(spheres: SphereModel, link: str, frame: np.ndarray) -> np.ndarray:
    found = [np.empty((0, 16))]
    for geometry, pose in spheres.fixed(link):
        placed = frame @ pose
        if not isinstance(geometry, Boxes):
            found.append(_solid(geometry, placed))
            continue
        boxes = geometry.corners
        solids = np.zeros((len(boxes), 16))
        solids[:, :3] = boxes.mean(axis=1) @ placed[:3, :3].T + placed[:3, 3]
        solids[:, 3:12], solids[:, 12:15] = placed[:3, :3].T.ravel(), 0.5 * (boxes[:, 1] - boxes[:, 0])
        found.append(solids)
    return np.concatenate(found)


def _solid(shape: Geometry, pose: np.ndarray) -> np.ndarray:
    bounds = bounds_of(shape)
    kind, half = kernels.BOX, np.asarray(bounds.half, dtype=float)
    if isinstance(shape, Sphere):
        kind = kernels.BALL
    elif isinstance(shape, Cylinder):
        kind = kernels.CYLINDER
    centre = pose[:3, :3] @ bounds.centre + pose[:3, 3]
    return np.concatenate([centre, pose[:3, :3].T.ravel(), half, [kind]])[None]


def _around(solids: np.ndarray) -> list[float]:
    """Centre and radius (4,) of a ball around solids (s, 16)."""
    reach = np.where(solids[:, 15] == kernels.BALL, solids[:, 12], np.linalg.norm(solids[:, 12:15], axis=1))
    low, high = (solids[:, :3] - reach[:, None]).min(axis=0), (solids[:, :3] + reach[:, None]).max(axis=0)
    centre = 0.5 * (low + high)
    return [*centre, float((np.linalg.norm(solids[:, :3] - centre, axis=1) + reach).max())]
