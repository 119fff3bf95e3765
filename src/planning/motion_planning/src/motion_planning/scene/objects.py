# SPDX-License-Identifier: BSD-3-Clause
"""Objects of a scene: in the world, or attached to the robot."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.errors import PlanningError
from motion_planning.shapes import TriangleMesh, read_only

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.shapes import Geometry, Placed

#: The octomap's name in an AllowedCollisions and in contacts.
OCTOMAP = "<octomap>"
#: Larger distances and sizes are refused as errors [m]; collision checks would lose millimetres there.
FARTHEST = 1e5


class SceneError(PlanningError):
    """A change or query that does not fit the scene."""


@dataclass(frozen=True, eq=False)
class WorldObject:
    """An object with shapes; immutable.

    pose (4, 4): of the object in the planning frame, or in the link that holds it. shapes: ((shape, pose (4, 4) in the
    object), ...), shapes of urdf_model (Box, Cylinder, Sphere, Plane) or of motion_planning.shapes.
    subframes: {name: pose (4, 4) in the object}. type: (key, database), as in ObjectType. Raises SceneError for an
    invalid pose, and for a size below 0, not finite, or too large.
    """

    id: str
    pose: np.ndarray
    shapes: tuple[Placed, ...]
    subframes: Mapping[str, np.ndarray] = field(default_factory=dict)
    type: tuple[str, str] = ("", "")

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", _pose(self.pose, self.id))
        object.__setattr__(self, "shapes", tuple((shape, _pose(pose, self.id)) for shape, pose in self.shapes))
        for shape, _ in self.shapes:
            _check_size(shape, self.id)
        if not isinstance(self.subframes, MappingProxyType):
            checked = {name: _pose(pose, self.id) for name, pose in self.subframes.items()}
            object.__setattr__(self, "subframes", MappingProxyType(checked))

    def at(self, pose: np.ndarray) -> WorldObject:
        """Return the object at another ``pose`` (4, 4)."""
        return replace(self, pose=pose)

    def with_shapes_of(self, other: WorldObject) -> WorldObject:
        """Return the object with the shapes and subframes of ``other``, given in the same frame, added. Raises
        SceneError for an invalid pose.
        """
        into = np.linalg.inv(self.pose) @ other.pose
        shapes = (*self.shapes, *((shape, into @ pose) for shape, pose in other.shapes))
        return replace(self, shapes=shapes,
                       subframes={**self.subframes, **{name: into @ pose for name, pose in other.subframes.items()}})


@dataclass(frozen=True, eq=False)
class AttachedBody:
    """An attached object; its pose is in the link that holds it.

    touch_links: the links that it may touch; the holding link is always included.
    detach_posture: the caller's data for the release; not used here.
    """

    object: WorldObject
    link: str
    touch_links: frozenset[str] = frozenset()
    detach_posture: object = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "touch_links", frozenset(self.touch_links) | {self.link})

    @property
    def id(self) -> str:
        return self.object.id


def _check_size(shape: Geometry, name: str) -> None:
    sizes = (*getattr(shape, "size", ()), *(getattr(shape, one) for one in ("radius", "length") if hasattr(shape, one)))
    if not all(0.0 <= size <= FARTHEST for size in sizes):
        raise SceneError("a %s of object '%s' has the sizes %s; expected 0 to %g m"
                         % (type(shape).__name__, name, ", ".join("%g" % size for size in sizes), FARTHEST))
    if isinstance(shape, TriangleMesh) and np.abs(shape.vertices).max() > FARTHEST:
        raise SceneError("a mesh of object '%s' reaches %g m; expected at most %g"
                         % (name, np.abs(shape.vertices).max(), FARTHEST))


def _pose(pose: ArrayLike, name: str) -> np.ndarray:
    matrix = read_only(pose)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise SceneError("a pose of object '%s' is %s; expected a finite (4, 4) matrix"
                         % (name, np.asarray(pose).tolist()))
    away = float(np.abs(matrix[:3, 3]).max())
    if away > FARTHEST:
        raise SceneError("object '%s' is %g m away; expected at most %g" % (name, away, FARTHEST))
    if abs(np.linalg.det(matrix[:3, :3]) - 1.0) > 1e-3 or not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise SceneError("a pose of object '%s' holds no rotation: %s" % (name, matrix.tolist()))
    return matrix
