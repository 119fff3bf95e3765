# SPDX-License-Identifier: BSD-3-Clause
"""Links as shapes that rviz's markers can show."""
from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.shapes import Cone, TriangleMesh
from urdf_model import Box, Cylinder, Mesh, Plane, Sphere

if TYPE_CHECKING:
    from urdf_model import Robot

    #: Red, green, blue, alpha.
    Colour = tuple[float, float, float, float]

GOAL, START, PATH = (1.0, 0.55, 0.1, 0.65), (0.2, 0.75, 0.3, 0.65), (0.45, 0.65, 1.0, 0.5)
COLLIDING = (0.95, 0.1, 0.1, 0.85)
THING, HELD = (0.35, 0.7, 0.35, 1.0), (0.7, 0.35, 0.7, 1.0)
#: Side and thickness of an infinite plane's marker [m].
_PLANE_M, _THIN_M = 4.0, 0.002
_CONE_SIDES = 24


class Solid(NamedTuple):
    """A shape as a marker shows it. kind: box, sphere, cylinder, mesh or triangles; pose (4, 4) in its link or
    object; size: scale of the marker's unit shape, x y z; mesh: its file; points (3 k, 3): corners of
    triangles."""

    kind: str
    pose: np.ndarray
    size: tuple[float, float, float]
    mesh: str = ""
    points: np.ndarray | None = None


class DrawnSolid(NamedTuple):
    """A Solid in a picture. name: of the link or object; number: counts the shapes of one name; pose (4, 4); colour
    r g b a."""

    name: str
    number: int
    solid: Solid
    pose: np.ndarray
    colour: Colour


def _three(values: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z


def solid_of(geometry: object, pose: np.ndarray) -> Solid | None:
    """Return the Solid of a shape of urdf_model or motion_planning.shapes; None for what cannot be drawn."""
    if isinstance(geometry, Box):
        return Solid("box", pose, _three(geometry.size))
    if isinstance(geometry, Sphere):
        return Solid("sphere", pose, _three([2.0 * geometry.radius] * 3))
    if isinstance(geometry, Cylinder):
        return Solid("cylinder", pose, (2.0 * geometry.radius, 2.0 * geometry.radius, geometry.length))
    if isinstance(geometry, Mesh):
        return Solid("mesh", pose, _three(geometry.scale), geometry.filename)
    if isinstance(geometry, Plane):
        return Solid("box", pose, (_PLANE_M, _PLANE_M, _THIN_M))
    if isinstance(geometry, Cone):
        return Solid("triangles", pose, (1.0, 1.0, 1.0), points=_cone(geometry))
    if isinstance(geometry, TriangleMesh):
        return Solid("triangles", pose, (1.0, 1.0, 1.0), points=geometry.vertices[geometry.triangles.ravel()])
    return None


def _cone(cone: Cone) -> np.ndarray:
    """Corners (3 k, 3) of the triangles of a Cone, outsides outwards."""
    angles = np.linspace(0.0, 2.0 * np.pi, _CONE_SIDES + 1)
    rim = np.stack([cone.radius * np.cos(angles), cone.radius * np.sin(angles),
                    np.full(len(angles), -0.5 * cone.length)], axis=1)
    apex, middle = (0.0, 0.0, 0.5 * cone.length), (0.0, 0.0, -0.5 * cone.length)
    sides = [(a, b, apex) for a, b in zip(rim[:-1], rim[1:], strict=True)]
    base = [(b, a, middle) for a, b in zip(rim[:-1], rim[1:], strict=True)]
    return np.array(sides + base, dtype=float).reshape(-1, 3)


def link_solids(robot: Robot, links: Iterable[str]) -> dict[str, tuple[Solid, ...]]:
    """Return {link: (Solid, ...)} of what is seen of ``links`` of a urdf_model.Robot; no entry without visuals."""
    solids = {}
    for name in links:
        found = [solid_of(shape.geometry, shape.origin) for shape in robot.links[name].visuals]
        found = tuple(solid for solid in found if solid is not None)
        if found:
            solids[name] = found
    return solids


def drawn(solids: Mapping[str, Sequence[Solid]], poses: Mapping[str, np.ndarray], colour: Colour,
          special: Mapping[str, Colour] | None = None) -> list[DrawnSolid]:
    """Return the DrawnSolid of ``solids`` {name: (Solid, ...)}. poses: {name: (4, 4)}; special: {name: its own
    colour}."""
    return [DrawnSolid(name, number, solid, poses[name] @ solid.pose, (special or {}).get(name, colour))
            for name, several in solids.items() for number, solid in enumerate(several)]
