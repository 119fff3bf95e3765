# SPDX-License-Identifier: BSD-3-Clause
"""Links that reach farther in a simulator than their meshes: there, a mesh is the convex hulls of its parts."""
from __future__ import annotations

import contextlib
import importlib
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from bullet_sim.convex_parts import AXES, cut
from motion_planning.scene import Scene, WorldObject
from motion_planning.shapes import TriangleMesh
from motion_planning.spheres.pair_maps import pair_map
from moveit_servo.settings import SettingsError

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel
    from motion_planning.spheres import SphereModel

#: Planes through the meshes of a link, as for ``bullet_sim.convex_parts.cut``, by the link's name.
MeshCuts = Mapping[str, Sequence[tuple]]

_SUFFIX = " (convex parts)"


def cuts_named(name: str, model: PlanningModel) -> MeshCuts:
    """Return the cuts of ``name``, module and attribute (``package.module.NAME``), for links of ``model``; none for an
    empty name. Raises SettingsError."""
    if not name:
        return {}
    module, _, attribute = name.rpartition(".")
    try:
        cuts = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise SettingsError("mesh_cuts is '%s', which cannot be found: %s" % (name, error)) from None
    if not isinstance(cuts, Mapping):
        raise SettingsError("mesh_cuts is '%s', a %s; expected a dictionary of a link's planes by its name"
                            % (name, type(cuts).__name__))
    for link, planes in cuts.items():
        if not (isinstance(planes, Sequence) and all(map(_is_plane, planes))):
            raise SettingsError("mesh_cuts is '%s', with %r for '%s'; expected planes (axis, offset) or (axis, offset, "
                                "low, high), the axis x, y or z" % (name, planes, link))
        if link in model.link_index and any(joint.movable for joint in model.robot.chain(model.root, link)):
            raise SettingsError("mesh_cuts is '%s' with link '%s', which moves; expected links that stand still"
                                % (name, link))
    return cuts


class ConvexParts:
    """The convex hulls of links' parts as objects of a scene. Each touches what the link may touch, and those links
    that are so near to it at any posture that only exact geometry tells them apart: the upper arm at its shoulder."""

    def __init__(self, sphere_model: SphereModel, cuts: MeshCuts) -> None:
        model = sphere_model.model
        self._links: list[tuple[str, tuple]] = []
        self._near: dict[str, list[str]] = {}
        for link in cuts:
            parts = sphere_model.parts(link) if link in model.link_index else ()
            shapes = tuple((hull, pose) for geometry, pose in parts if isinstance(geometry, TriangleMesh)
                           for hull in _hulls(geometry, cuts[link]))
            if shapes:
                self._links.append((link, shapes))
                self._near[link] = [other for other in model.links if sphere_model.maps(
                    (link, other), lambda link=link, other=other: pair_map(sphere_model, link, other)) is not None]
        self._model = model

    def added_to(self, scene: Scene) -> Scene:
        """Return ``scene`` with the parts."""
        frames = dict(zip(self._model.links, self._model.frames(scene.state.q, scene.state.base), strict=True))
        allowed = scene.allowed
        for link, shapes in self._links:
            name = link + _SUFFIX
            scene = scene.with_object(WorldObject(name, frames[link], shapes))
            allowed = allowed.with_entries({(name, other): True for other in self._model.links if other == link
                                            or other in self._near[link] or allowed.allowed(link, other)})
        return scene.with_allowed(allowed)


def _is_plane(plane: object) -> bool:
    return (isinstance(plane, tuple | list) and len(plane) in (2, 4) and plane[0] in tuple(AXES)
            and all(isinstance(number, int | float) and math.isfinite(number) for number in plane[1:]))


def _hulls(mesh: TriangleMesh, planes: Sequence[tuple]) -> Iterator[TriangleMesh]:
    """The convex hulls of the parts of a mesh; without flat ones, which it contains itself."""
    for part in cut(mesh.vertices[mesh.triangles], planes):
        points = np.array(part)
        with contextlib.suppress(QhullError):
            yield TriangleMesh(points, ConvexHull(points).simplices)
