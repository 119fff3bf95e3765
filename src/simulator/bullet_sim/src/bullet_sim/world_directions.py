# SPDX-License-Identifier: BSD-3-Clause
"""Friction whose two coefficients differ in a surface without a direction (mu and mu2 without Gazebo's fdir1).

ODE then takes the directions of each contact from its normal n, in the world's axes: where |n_z| > 0.71, as on a floor,
mu is along the world's y axis and mu2 along x (``dPlaneSpace``). Bullet scales the friction of a body along the axes of
its inertial frame. So the scales follow the body as it turns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from .builder import most_friction
from .directions import directed
from .multibodies import link_indices
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from .model import Model
    from .multibodies import LinkPlace

# Scales that differ by less are the same, as are axes whose slopes do [1].
_SAME, _LEVEL = 1e-3, 0.01


class _Footing(NamedTuple):
    """A link in Bullet whose friction has the world's directions: coefficients along the world's y axis and x axis."""

    place: LinkPlace
    along: float
    across: float


class WorldDirections:
    """The links of a Model whose friction has the world's directions, as long as the Model is there."""

    def __init__(self, client: int, model: Model) -> None:
        """``client``: PyBullet's."""
        self._client, self._model = client, model
        self._left_out = frozenset()
        self._begin()

    def _begin(self) -> None:
        """Of multibodies that are new."""
        self._parts = self._model.parts
        self._footings = list(self._find())
        self._turns, self._scales = {}, {}

    def _find(self) -> Iterator[_Footing]:
        merged, parts = self._model.merged, self._model.parts
        by_child, indices = {joint.child: joint for joint in merged.joints.values()}, link_indices(merged)
        for name, link in merged.links.items():
            surfaces = link.surface, *(patch.surface for patch in link.patches)
            if name in self._left_out:
                continue
            for place, surface in zip(parts.all_places(indices[name]), surfaces, strict=True):
                found = directed(surface, most_friction(by_child.get(name)))
                if found is not None and found.direction is None:
                    yield _Footing(place, found.along, found.across)

    def __bool__(self) -> bool:
        return bool(self._footings)

    def leave(self, bodies: Iterable[str]) -> None:
        """From now on, others tell Bullet the friction of these bodies."""
        self._left_out |= frozenset(bodies)
        self._begin()

    def follow(self) -> None:
        """Before a step: turn the directions against bodies that have turned."""
        if self._parts is not self._model.parts:
            self._begin()
        for footing in self._footings:
            turn = self._turn(footing.place)
            if turn == self._turns.get(footing.place):
                continue
            self._turns[footing.place] = turn
            scales, known = scales_of(footing.along, footing.across, turn), self._scales.get(footing.place)
            if known is None or max(abs(new - old) for new, old in zip(scales, known, strict=True)) > _SAME:
                self._scales[footing.place] = scales
                pybullet.changeDynamics(*footing.place, anisotropicFriction=scales, physicsClientId=self._client)

    def _turn(self, place: LinkPlace) -> tuple[float, ...]:
        """The quaternion of a link's inertial frame in the world."""
        if place.index < 0:
            return pybullet.getBasePositionAndOrientation(place.body, physicsClientId=self._client)[1]
        # Without the velocities, and of the poses that Bullet has now.
        return pybullet.getLinkState(*place, physicsClientId=self._client)[1]


def scales_of(along: float, across: float, quaternion: Sequence[float]) -> list[float]:
    """The scales (3,) of the larger of two coefficients, along the axes of a body with that orientation in the world.

    ``along`` acts along the world's y axis, ``across`` it along x. Exact where the most level of the axes is along one
    of these; between them, each axis has its share of both, and a force across the motion is missing.
    """
    most = max(along, across)
    if most == 0.0:
        return [1.0] * 3
    rows = pybullet.getMatrixFromQuaternion(quaternion)
    slopes = [abs(value) if abs(value) > _LEVEL else 0.0 for value in rows[6:9]]
    level = slopes.index(min(slopes))
    x, y = rows[level], rows[3 + level]
    share = y * y / (x * x + y * y)
    scales = [(along + (across - along) * share) / most] * 3
    scales[level] = (across + (along - across) * share) / most
    return scales
