# SPDX-License-Identifier: BSD-3-Clause
"""Maps of where two links of one arm touch each other, for links that pass each other closely.

Forearm and second wrist link of many arms are everywhere a centimetre apart: spheres around them overlap at almost
every posture. If two joints lead from one link to the other, these alone decide whether the links touch, so exact
geometry is asked once about all their values. A closed cell of such a map contains a posture that may touch.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import fcl
import numpy as np

from motion_planning.exact.geometry import bounds_of, fcl_geometry
from motion_planning.shapes import TriangleMesh
from motion_planning.spheres.cover import cover
from motion_planning.spheres.kernel import CELLS
from motion_planning.spheres.sphere_model import cached, fitting

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel
    from motion_planning.shapes import Geometry, Placed
    from motion_planning.spheres import SphereModel

    _Motion = tuple[tuple[float, ...], ...]

# Size of a cell [rad]. The values are those of a joint within a turn, from 0.
_SIZE = 2.0 * math.pi / CELLS
# A cell is open only if the links are this much further apart than they can move within it [m].
_ROUNDING = 5e-4
# Spheres are good enough if they touch at most at this share of so many by so many values.
_SELDOM, _LOOKED_AT = 0.05, 8


class PairMap(NamedTuple):
    """variables: of the two joints, indices into the model's. closed (CELLS, CELLS) uint8: whether the links may touch
    where the joints are in that cell of a turn."""

    variables: tuple[int, int]
    closed: np.ndarray


def pair_map(sphere_model: SphereModel, link: str, other: str) -> PairMap | None:
    """Return the PairMap of two links of a SphereModel, one of which carries the other by exactly two joints that turn;
    None if there is no such map, or if spheres are good enough. Made once, and kept on disk."""
    way = _way(sphere_model.model, link, other) or _way(sphere_model.model, other, link)
    if way is None:
        return None
    first, last, variables, motion = way
    parts = sphere_model.parts(first), sphere_model.parts(last)
    tolerances = [fitting(some, sphere_model.tolerance) for some in parts]
    closed = cached(closed_cells, [*parts[0], *parts[1]], (len(parts[0]), *tolerances, motion))
    return PairMap(variables, closed) if closed.size else None


def closed_cells(parts: Sequence[Placed], about: tuple[Any, ...]) -> np.ndarray:
    """Return (CELLS, CELLS) uint8 of two links, (0, 0) if their spheres seldom touch.

    parts: those of both links, [(geometry, pose (4, 4))]. about: how many are the first link's; tolerances of the
    spheres of both; motion as from ``_way``.
    """
    count, *tolerances, motion = about
    links = parts[:count], parts[count:]
    one, other = (cached(cover, some, tolerance) for some, tolerance in zip(links, tolerances, strict=True))
    turns = 2.0 * math.pi * np.arange(_LOOKED_AT) / _LOOKED_AT
    if np.mean([_spheres_touch(one, other, _moved(motion, u, v)) for u in turns for v in turns]) <= _SELDOM:
        return np.empty((0, 0), np.uint8)
    fixed, moving = ([(fcl_geometry(shape), pose) for shape, pose in some] for some in links)
    values = (np.arange(CELLS) + 0.5) * _SIZE
    margin = 0.5 * _SIZE * sum(_reaches(motion, links[1], values)) + _ROUNDING
    return np.array([[_distance(fixed, moving, _moved(motion, u, v)) <= margin for v in values] for u in values],
                    np.uint8)


def _way(model: PlanningModel, link: str, other: str) -> tuple[str, str, tuple[int, int], _Motion] | None:
    """(link, other, indices of two variables, motion) if exactly two joints lead from ``link`` down to ``other``, both
    of which turn and mimic none; else None. motion: the pose before the first joint, its axis, the pose between them,
    the second's axis, and the pose behind it, as tuples of numbers."""
    parents, origins, axes, kinds, variables, factors = model.kinematics
    at, end = model.link_index[other], model.link_index[link]
    poses, joints = [np.eye(4)], []
    while at != end:
        if parents[at] < 0:
            return None
        if kinds[at]:
            if kinds[at] != 1 or variables[at] < 0 or tuple(factors[at]) != (1.0, 0.0) or len(joints) == 2:
                return None
            joints.insert(0, (int(variables[at]), axes[at]))
            poses.insert(0, origins[at])
        else:
            poses[0] = origins[at] @ poses[0]
        at = parents[at]
    if len(joints) != 2:
        return None
    motion = poses[0], joints[0][1], poses[1], joints[1][1], poses[2]
    return link, other, tuple(joint[0] for joint in joints), tuple(tuple(map(float, np.ravel(one))) for one in motion)


def _moved(motion: _Motion, u: float, v: float) -> np.ndarray:
    """The pose of the second link in the frame of the first, its joints at ``u`` and ``v``."""
    before, first, between, second, behind = motion
    return (np.reshape(before, (4, 4)) @ _turn(first, u) @ np.reshape(between, (4, 4)) @ _turn(second, v)
            @ np.reshape(behind, (4, 4)))


def _turn(axis: Sequence[float], angle: float) -> np.ndarray:
    """A rotation about ``axis`` by Rodrigues' formula, (4, 4)."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return pose


def _spheres_touch(some: np.ndarray, others: np.ndarray, pose: np.ndarray) -> bool:
    centres = others[:, :3] @ pose[:3, :3].T + pose[:3, 3]
    apart = np.linalg.norm(some[:, None, :3] - centres, axis=2)
    return (apart < some[:, None, 3] + others[:, 3]).any()


def _reaches(motion: _Motion, parts: Sequence[Placed], values: np.ndarray) -> tuple[float, float]:
    """How far the farthest point of the second link is from each joint's axis at most [m]."""
    _, first, between, second, behind = motion
    corners = np.concatenate([_corners(shape) @ pose[:3, :3].T + pose[:3, 3] for shape, pose in parts])
    behind, between = np.reshape(behind, (4, 4)), np.reshape(between, (4, 4))
    corners = corners @ behind[:3, :3].T + behind[:3, 3]
    reach = _from_axis(second, corners)
    turned = [corners @ pose[:3, :3].T + pose[:3, 3] for pose in (between @ _turn(second, v) for v in values)]
    # Between two of these values no point moves further than that.
    return max(_from_axis(first, points) for points in turned) + 0.5 * _SIZE * reach, reach


def _corners(shape: Geometry) -> np.ndarray:
    """Points (n, 3) whose convex hull contains the shape."""
    bounds = bounds_of(shape)
    if isinstance(shape, TriangleMesh):
        return shape.vertices
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    return bounds.centre + signs * bounds.half


def _from_axis(axis: Sequence[float], points: np.ndarray) -> float:
    return float(np.linalg.norm(np.cross(points, np.array(axis) / np.linalg.norm(axis)), axis=1).max())


def _distance(fixed: Sequence[tuple[Any, np.ndarray]], moving: Sequence[tuple[Any, np.ndarray]],
              pose: np.ndarray) -> float:
    """The least distance of two links [m], 0 if they touch."""
    least = math.inf
    for geometry, where in fixed:
        one = fcl.CollisionObject(geometry, fcl.Transform(where[:3, :3], where[:3, 3]))
        for other, inner in moving:
            place = pose @ inner
            second = fcl.CollisionObject(other, fcl.Transform(place[:3, :3], place[:3, 3]))
            if fcl.collide(one, second, fcl.CollisionRequest(), fcl.CollisionResult()):
                return 0.0
            least = min(least, fcl.distance(one, second, fcl.DistanceRequest(), fcl.DistanceResult()))
    return max(0.0, least)
