# SPDX-License-Identifier: BSD-3-Clause
"""The body under a pixel: the ray through it, and the first thing that it hits. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from sensor_renderer.mirror import Mirror
    from sensor_renderer.pinhole import Pinhole

_PARALLEL = 1e-12


class Hit(NamedTuple):
    """``model``, ``link``: names, the link that of its body; ``point`` (3,) [m, world]; ``distance`` from the start of
    the ray [m]."""

    model: str
    link: str
    point: np.ndarray
    distance: float


def ray(pinhole: Pinhole, pose: np.ndarray, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """(origin (3,), unit direction (3,)) in the world of the ray through the pixel ``x``, ``y`` of a camera whose
    optical frame is at ``pose`` (4, 4)."""
    local = np.array([(x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy, 1.0])
    direction = pose[:3, :3] @ local
    return pose[:3, 3].copy(), direction / np.linalg.norm(direction)


def first_hit(mirror: Mirror, origin: np.ndarray, direction: np.ndarray) -> Hit | None:
    """The :class:`Hit` of a ray with the triangles of a :class:`sensor_renderer.mirror.Mirror`; None if there is none.
    """
    nearest = None
    for model, body in mirror.bodies.items():
        for link, parts, matrix in zip(body.link_names, body.parts, body.matrices, strict=True):
            if not parts:
                continue
            rotation = matrix[:3, :3]
            start, ahead = rotation.T @ (origin - matrix[:3, 3]), rotation.T @ direction
            for part in parts:
                distance = _distance(part.triangles[:, :3], start, ahead)
                if distance is not None and (nearest is None or distance < nearest.distance):
                    nearest = Hit(model, link, origin + distance * direction, distance)
    return nearest


def on_plane(origin: np.ndarray, direction: np.ndarray, point: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
    """Where a ray meets the plane through ``point`` (3,) with ``normal`` (3,); None if it does not."""
    slope = float(direction @ normal)
    distance = float((point - origin) @ normal) / slope if abs(slope) > _PARALLEL else -1.0
    return origin + distance * direction if distance > 0.0 else None


def _distance(corners, start, ahead):
    """The distance to the nearest of the triangles ``corners`` (3 m, 3), or None.

    Möller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997; both sides count.
    """
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre = (low + high) / 2.0
    aside = np.cross(centre - start, ahead)
    if aside @ aside > np.sum((high - low) ** 2) / 4.0:
        return None  # it passes beside the sphere around all
    first = corners[0::3].astype(float)
    along, across = corners[1::3] - first, corners[2::3] - first
    upright = np.cross(ahead, across)
    volume = np.einsum("ij,ij->i", along, upright)
    solid = np.abs(volume) > _PARALLEL
    first, along, across, upright, volume = first[solid], along[solid], across[solid], upright[solid], volume[solid]
    to_start = start - first
    u = np.einsum("ij,ij->i", to_start, upright) / volume
    sideways = np.cross(to_start, along)
    v = sideways @ ahead / volume
    distance = np.einsum("ij,ij->i", across, sideways) / volume
    hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0)
    return float(distance[hit].min()) if hit.any() else None
