# SPDX-License-Identifier: BSD-3-Clause
"""Links as markers for rviz."""
from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from motion_planning.model import ModelError
from urdf_model import Box, Cylinder, Mesh, Sphere

from .conversions import pose_of
from .exception import MoveItCommanderException

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel, State
    from urdf_model import Shape

_GREY = (0.5, 0.5, 0.5, 1.0)


def link_markers(model: PlanningModel, state: State, links: Iterable[str]) -> list[Marker]:
    """Return a Marker for each visual shape of ``links`` in the planning frame. Planes are left out."""
    markers = []
    for name in links:
        try:
            frame = model.frame_of(state.q, name, state.base)
        except ModelError as error:
            raise MoveItCommanderException(str(error)) from None
        for shape in model.robot.links[name].visuals:
            marker = _marker(shape)
            if marker is not None:
                marker.header.frame_id, marker.ns, marker.id = model.frame, name, len(markers)
                marker.pose = pose_of(frame @ shape.origin)
                markers.append(marker)
    return markers


def _marker(shape: Shape) -> Marker | None:
    geometry = shape.geometry
    marker = Marker(color=ColorRGBA(*(shape.colour or _GREY)))
    if isinstance(geometry, Box):
        marker.type, marker.scale = Marker.CUBE, Vector3(*geometry.size)
    elif isinstance(geometry, Sphere):
        marker.type, marker.scale = Marker.SPHERE, Vector3(*[2.0 * geometry.radius] * 3)
    elif isinstance(geometry, Cylinder):
        width = 2.0 * geometry.radius
        marker.type, marker.scale = Marker.CYLINDER, Vector3(width, width, geometry.length)
    elif isinstance(geometry, Mesh):
        marker.type, marker.scale = Marker.MESH_RESOURCE, Vector3(*geometry.scale)
        marker.mesh_resource, marker.mesh_use_embedded_materials = geometry.filename, True
    else:
        return None
    return marker
