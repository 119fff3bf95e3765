# SPDX-License-Identifier: BSD-3-Clause
"""Collision checks of configurations and edges of a group by spheres, many at once."""
from __future__ import annotations

import copy
import functools
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.spheres import kernel
from motion_planning.spheres.sphere_model import Patience
from motion_planning.spheres.tables import bake, between, split

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.model import Group
    from motion_planning.scene import Scene
    from motion_planning.spheres import SphereModel

#: States on an edge are at most this far apart [rad, the Euclidean distance of joint values].
RESOLUTION = 1.0 / 64.0


class SphereChecker:
    """A scene prepared for one group. It is immutable, so threads can share it.

    tables: (robot, world), see ``kernel``. resolution [rad]: distance of the checked states on an edge. remarks:
    sentences on what is coarser than usual, because it is large or there was no time.
    """

    def __init__(self, sphere_model: SphereModel, group: Group, scene: Scene, resolution: float = RESOLUTION,
                 patience: Patience | None = None) -> None:
        """patience: Patience with the preparation; None: no end."""
        self.group, self.resolution = group, resolution
        self.tables, self.remarks = bake(sphere_model, group, scene, scene.state, patience or Patience())

    def valid(self, states: ArrayLike) -> np.ndarray:
        """Return (m,) bool: whether each of ``states`` (m, k) is free of collisions."""
        states = np.ascontiguousarray(np.atleast_2d(states), dtype=np.float32)
        free = np.empty(len(states), dtype=bool)
        if len(states):
            kernel.free_states(self.tables, states, free)
        return free

    def at(self, resolution: float) -> SphereChecker:
        """Return this checker with another ``resolution`` [rad] of edges."""
        return self._but(resolution=resolution)

    @functools.cached_property
    def parts(self) -> list[tuple[np.ndarray, SphereChecker]]:
        """[(indices (j,) of the group's joints, SphereChecker of these alone)] of parts that move independently of each
        other, each by its own joints. Collisions between parts are not checked. Empty if there are fewer than two.
        """
        return [(indices, self._but(tables=tables)) for indices, tables in split(self.tables)]

    @functools.cached_property
    def between_parts(self) -> SphereChecker:
        """The SphereChecker of collisions of parts with each other alone: the rest of what may happen on a path that is
        free for each of ``parts``."""
        return self._but(tables=between(self.tables))

    def _but(self, **changes: object) -> SphereChecker:
        other = copy.copy(self)
        for name in ("parts", "between_parts"):
            other.__dict__.pop(name, None)
        other.__dict__.update(changes)
        return other

    def edge(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Whether the straight line from ``a`` to ``b`` (k,) is free; ``a`` itself is not checked."""
        return self.way((a, b))

    def way(self, points: ArrayLike) -> bool:
        """Whether all straight lines between ``points`` (m, k) are free; the first point is not checked."""
        points = np.ascontiguousarray(points, dtype=np.float32)
        return bool(kernel.free_way(self.tables, points, np.float32(self.resolution)))

    def edges(self, points: ArrayLike, known: np.ndarray | None = None) -> np.ndarray:
        """Return (m - 1,) bool: whether each straight line between ``points`` (m, k) is free; the first point is not
        checked. known (m - 1,) bool: those that are free for certain."""
        points = np.ascontiguousarray(points, dtype=np.float32)
        free = np.zeros(len(points) - 1, dtype=bool) if known is None else np.array(known, dtype=bool)
        kernel.free_edges(self.tables, points, np.float32(self.resolution), free)
        return free
