# SPDX-License-Identifier: BSD-3-Clause
"""The hand at each grasp or place that was offered, as markers."""
from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from moveit_ros_move_group.convert.geometry import pose_of
from urdf_model import Box, Cylinder, Mesh, Sphere

if TYPE_CHECKING:
    from motion_planning.manipulation import Candidate, Fall
    from moveit_ros_move_group.capabilities.pick_place import _Job

#: Of the one that works, of those that fell, and of those that were not tried.
WORKS, FELL, UNTRIED = (0.2, 0.8, 0.3, 0.9), (0.9, 0.15, 0.1, 0.3), (0.6, 0.6, 0.6, 0.3)


def hands(job: _Job, chosen: Candidate | None, falls: Iterable[Fall]) -> MarkerArray:
    """Return the MarkerArray of a pick or place: each Candidate's hand where it closes or opens, its posture before.

    job: has task, candidates and hand (names of links); chosen: the Candidate that works, or None; falls: Falls.
    """
    model, fallen = job.task.scene.model, {fall.candidate for fall in falls}
    markers = [Marker(action=Marker.DELETEALL)]
    markers[0].header.frame_id = model.frame
    for candidate in job.candidates:
        colour = WORKS if candidate is chosen else FELL if candidate.name in fallen else UNTRIED
        markers += _hand(job, candidate, colour)
    return MarkerArray(markers)


def _hand(job: _Job, candidate: Candidate, colour: tuple[float, float, float, float]) -> list[Marker]:
    model, state = job.task.scene.model, job.task.scene.state
    opened = {name: float(np.clip(value, *model.bounds[model.index[name]]))
              for name, value in candidate.before.items() if name in model.index}
    frames = model.frames(state.with_joints(opened).q, state.base)
    # From the link's present pose to its target.
    moved = candidate.pose @ np.linalg.inv(frames[model.link_index[job.task.link]])
    found = []
    for link in sorted(job.hand):
        for visual in model.robot.links[link].visuals:
            shown = _shape(visual.geometry)
            if shown is None:
                continue
            kind, size = shown
            marker = Marker(ns=candidate.name, id=len(found), type=kind, scale=Vector3(*size), color=ColorRGBA(*colour),
                            pose=pose_of(moved @ frames[model.link_index[link]] @ visual.origin),
                            mesh_resource=visual.geometry.filename if kind == Marker.MESH_RESOURCE else "")
            marker.header.frame_id = model.frame
            found.append(marker)
    return found


def _shape(geometry: object) -> tuple[int, tuple[float, float, float]] | None:
    """(type of a Marker, its scale); None for what no marker shows."""
    if isinstance(geometry, Mesh):
        size = geometry.scale
        return Marker.MESH_RESOURCE, (size[0], size[1], size[2])
    if isinstance(geometry, Box):
        size = geometry.size
        return Marker.CUBE, (size[0], size[1], size[2])
    if isinstance(geometry, Sphere):
        diameter = 2.0 * geometry.radius
        return Marker.SPHERE, (diameter, diameter, diameter)
    if isinstance(geometry, Cylinder):
        return Marker.CYLINDER, (2.0 * geometry.radius, 2.0 * geometry.radius, geometry.length)
    return None
