# SPDX-License-Identifier: BSD-3-Clause
"""Replace missing meshes by primitives, so that a robot without its mesh files can be seen and touched."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Box, Cylinder, Mesh, Shape, Sphere
from urdf_model.transforms import rigid

from .errors import BulletSimError
from .shapes import principal_axes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from urdf_model import Inertial, Link, Robot

    from .shapes import MeshFiles

# A link's inertia is trusted if the homogeneous box with that inertia has a size [m] and density [kg/m^3] within these
# ranges, from balsa to platinum. Some descriptions have masses of 1e-5 kg and inertias of 10 kg m^2.
_SIDES_M = (0.002, 1.5)
_DENSITIES = (20.0, 22000.0)
# Rod between two joints: ratio of radius to length, and range of the radius [m].
_SLENDERNESS = 0.15
_RADII_M = (0.008, 0.06)
_UNKNOWN_RADIUS_M = 0.03


def with_stand_ins(robot: Robot, mesh_files: MeshFiles) -> tuple[Robot, str]:
    """Return ``robot`` with a primitive for each missing mesh, and one line for the log; the same robot and "" if no
    mesh is missing.

    A link's own other shapes are taken first, then a box with its inertia, then a rod or ball that fits between the
    joints. ``mesh_files``: MeshFiles.
    """
    told, links = [], {}
    for link in robot.links.values():
        collisions, lost = _sift(link.collisions, mesh_files.wavefront)
        visuals, unseen = _sift(link.visuals, mesh_files.path)
        if not lost and not unseen:
            continue
        # A visual mesh is not used: it may be too fine for collisions.
        spare = collisions or [shape for shape in visuals if not isinstance(shape.geometry, Mesh)]
        spare = spare or [_fitted(robot, link)]
        if lost and not collisions:
            collisions = [dataclasses.replace(shape, name=lost[0][0].name) for shape in spare]
        if unseen and not visuals:
            colour = next((shape.colour for shape, _ in unseen if shape.colour is not None), None)
            visuals = [dataclasses.replace(shape, colour=shape.colour or colour) for shape in spare]
        links[link.name] = dataclasses.replace(link, visuals=visuals, collisions=collisions)
        kinds = sorted({type(shape.geometry).__name__.lower() for shape in spare})
        reasons = list(dict.fromkeys(reason for _, reason in (*lost, *unseen)))
        told.append("%s; a %s replaces it in link '%s'" % ("; ".join(reasons), " and a ".join(kinds), link.name))
    if not links:
        return robot, ""
    return dataclasses.replace(robot, links={**robot.links, **links}), "; ".join(told)


def _sift(shapes: Iterable[Shape], check: Callable[[Mesh], str]) -> tuple[list[Shape], list[tuple[Shape, str]]]:
    """Return the shapes that can be used, and the others as (shape, why)."""
    usable, lost = [], []
    for shape in shapes:
        try:
            if isinstance(shape.geometry, Mesh):
                check(shape.geometry)
            usable.append(shape)
        except BulletSimError as error:
            lost.append((shape, str(error)))
    return usable, lost


def _fitted(robot: Robot, link: Link) -> Shape:
    """Return a Shape for a link of which only inertia and joints are known."""
    return equivalent_box(link.inertial) or _between_joints(robot, link)


def equivalent_box(inertial: Inertial | None) -> Shape | None:
    """Return the Shape of the homogeneous box with the mass and the principal moments of ``inertial``, or None.

    From I_x = m (b^2 + c^2) / 12 and its like: a^2 = 6 (I_y + I_z - I_x) / m. None if a link cannot have that size or
    density.
    """
    if inertial is None or inertial.mass <= 0.0:
        return None
    moments, axes = principal_axes(inertial.inertia)
    squares = 6.0 * (moments.sum() - 2.0 * moments) / inertial.mass
    if squares.min() < 0.0:
        return None
    sides = np.sqrt(squares)
    if sides.min() < _SIDES_M[0] or sides.max() > _SIDES_M[1]:
        return None
    if not _DENSITIES[0] <= inertial.mass / sides.prod() <= _DENSITIES[1]:
        return None
    return Shape(Box(tuple(sides.tolist())), rigid(axes, inertial.centre))


def _between_joints(robot: Robot, link: Link) -> Shape:
    """Return a rod from the link's joint to the farthest next one, or a ball at the end of a chain."""
    ends = [joint.origin[:3, 3] for joint in robot.children(link.name)]
    far = max(ends, key=np.linalg.norm, default=np.zeros(3))
    length = float(np.linalg.norm(far))
    if length > 2.0 * _RADII_M[0]:
        radius = float(np.clip(_SLENDERNESS * length, *_RADII_M))
        return Shape(Cylinder(radius, length), rigid(_turn_z_to(far / length), far / 2.0), link=link.name)
    parent = robot.parent_joint(link.name)
    reach = 0.0 if parent is None else float(np.linalg.norm(parent.origin[:3, 3]))
    radius = float(np.clip(_SLENDERNESS * reach, *_RADII_M)) if reach else _UNKNOWN_RADIUS_M
    return Shape(Sphere(radius), np.eye(4), link=link.name)


def _turn_z_to(direction: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) that takes the z axis to the unit vector ``direction``."""
    beside = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(beside, direction)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(direction, x), direction))
