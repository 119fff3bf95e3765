# SPDX-License-Identifier: BSD-3-Clause
"""Wheels whose contacts slip by a part of their speed for each part of their load that they transmit, as tyres do.

Bullet's friction holds a contact until it breaks loose. Where a wheel turns fast enough for a force of its slip to be
stable, that force replaces Bullet's friction, axis by axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .builder import inertial_frame, most_friction
from .errors import BulletSimError
from .mass_matrix import mass_matrix_of, motion_of_point
from .pose import Pose
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .model import Model
    from .multibodies import LinkPlace

# A force of the slip takes over from a compliance on that is stable, and lets go below this part of it.
_LETS_GO = 0.8
# Cosine between an axle and the axis of inertia that Bullet has for it.
_ALONG = 0.999


@dataclass
class Slip:
    """A wheel: its body, on a joint that turns; ``radius`` [m]; ``load`` [N] that it is made for; and the slip, in
    parts of the speed of its tread, for each part of the load that its contact transmits along the axle (``lateral``)
    and across it (``longitudinal``). 0: it does not slip."""

    body: str
    radius: float
    load: float
    lateral: float = 0.0
    longitudinal: float = 0.0


class _Touch(NamedTuple):
    """The contact of a wheel: where (3,), directions along the axle and across it (3,) each, the speed of the wheel's
    surface against the other (3,), the speed of its tread, the load [N], the other's friction, and where Bullet has the
    other, None for one that stands fast."""

    wheel: Slip
    place: np.ndarray
    axes: tuple[np.ndarray, np.ndarray]
    slip: np.ndarray
    tread: float
    load: float
    friction: float
    other: tuple[int, int] | None


class SlippingWheels:
    """The :class:`Slip` of some wheels of a Model, from its making until :meth:`end`."""

    def __init__(self, client: int, model: Model, wheels: Sequence[Slip], step_s: float) -> None:
        """``client``: PyBullet's; ``step_s``: length of a tick [s].

        Raises BulletSimError for a body without a joint that turns before it.
        """
        self._client, self._model, self.wheels, self._step_s = client, model, tuple(wheels), step_s
        self._numbers = {joint.child: number for number, joint in enumerate(model.merged.joints.values())}
        self._joints = {joint.child: joint for joint in model.merged.joints.values()}
        for wheel in self.wheels:
            joint = self._joints.get(wheel.body)
            if joint is None or joint.type == "prismatic":
                raise BulletSimError("'%s' of model '%s' is no wheel: no joint turns it" % (wheel.body, model.name))
        self._friction = {wheel.body: self._coefficients(wheel.body) for wheel in self.wheels}
        #: The bodies that slip along both axes or not at all: Bullet has no axis of inertia for their axles.
        self.crooked = [wheel.body for wheel in self.wheels if self._axis(wheel.body)[1] < _ALONG]
        self._begin()

    def _begin(self) -> None:
        """Of a multibody that is new, or has another step."""
        self._parts = self._model.parts
        self._own = {wheel.body: (False, False) for wheel in self.wheels}
        self._least, self._touching = (0.0, 0.0), 0

    def step_changed(self, step_s: float) -> None:
        """From the next tick on, it lasts ``step_s`` [s]."""
        self._step_s, self._touching = step_s, 0

    def end(self) -> None:
        """Give the contacts back to Bullet's friction."""
        for wheel in self.wheels:
            self._take(wheel, (False, False))

    def _axis(self, body: str) -> tuple[int, float]:
        """Which axis of a body's inertia is nearest to its axle, and the cosine between them."""
        axes = inertial_frame(self._model.merged.links[body])[:3, :3]
        near = np.abs(axes.T @ self._joints[body].axis)
        return int(near.argmax()), float(near.max())

    def _coefficients(self, body: str) -> tuple[float, float]:
        """(along the axle, across it) of the friction, with what ``fdir1`` says of it, which is along the axle."""
        surface, most = self._model.merged.links[body].surface, most_friction(self._joints[body])
        along = 1.0 if surface is None or surface.friction is None else surface.friction
        across = along
        if surface is not None and surface.direction is not None and surface.friction_across is not None:
            across = surface.friction_across
        return min(along, most), min(across, most)

    def push(self) -> None:
        """Before a step: the forces of the slip."""
        if self._parts is not self._model.parts:
            self._begin()
        found = [touch for touch in map(self._touch, self.wheels) if touch is not None]
        if len(found) > self._touching:
            self._least, self._touching = self._stable(found), len(found)
        for touch in found:
            wheel, own, force = touch.wheel, list(self._own[touch.wheel.body]), np.zeros(3)
            for axis, compliance in enumerate((wheel.lateral, wheel.longitudinal)):
                viscosity = compliance * touch.tread / wheel.load  # [m/s/N]
                least = self._least[axis] * (_LETS_GO if own[axis] else 1.0)
                own[axis] = compliance > 0.0 and viscosity >= least
                if own[axis]:
                    most = touch.load * touch.friction * self._friction[wheel.body][axis]
                    force -= touch.axes[axis] * np.clip(touch.axes[axis] @ touch.slip / viscosity, -most, most)
            self._take(wheel, (own[0], own[1]))
            if any(self._own[wheel.body]):
                self._apply(self._place(wheel), force, touch.place)
                if touch.other is not None:
                    self._apply(touch.other, -force, touch.place)

    def _place(self, wheel: Slip) -> LinkPlace:
        return self._model.parts.places[self._numbers[wheel.body]]

    def _apply(self, where: tuple[int, int], force: np.ndarray, place: np.ndarray) -> None:
        pybullet.applyExternalForce(*where, force.tolist(), place.tolist(), pybullet.WORLD_FRAME,
                                    physicsClientId=self._client)

    def _touch(self, wheel: Slip) -> _Touch | None:
        """The contact of a wheel in the last step, the mean of several; None for a wheel that touches nothing."""
        where = self._place(wheel)
        points = pybullet.getContactPoints(bodyA=where.body, linkIndexA=where.index, physicsClientId=self._client) or ()
        rows = []
        for point in points:
            sign = 1.0 if (point[1], point[3]) == where else -1.0
            other = (point[2], point[4]) if sign > 0.0 else (point[1], point[3])
            if point[9] > 0.0:
                rows.append((point[9], np.array(point[5 if sign > 0.0 else 6]), sign * np.array(point[7]), other))
        if not rows:
            return None
        load = sum(row[0] for row in rows)
        place = np.sum([row[0] * row[1] for row in rows], axis=0) / load
        normal = np.sum([row[0] * row[2] for row in rows], axis=0)
        state = pybullet.getLinkState(*where, computeLinkVelocity=1, physicsClientId=self._client)
        axle = Pose(state[4], state[5]).matrix()[:3, :3] @ self._joints[wheel.body].axis
        ahead = np.cross(axle, normal)
        length = float(np.linalg.norm(ahead))
        if length < 1e-3 * load:  # it lies on its side
            return None
        ahead /= length
        turn, other = np.array(state[7]), max(rows, key=lambda row: row[0])[3]
        slip = np.array(state[6]) + np.cross(turn, place - np.array(state[0]))
        mass, friction = pybullet.getDynamicsInfo(*other, physicsClientId=self._client)[:2]
        if mass > 0.0:
            slip -= self._speed(other, place)
        return _Touch(wheel, place, (np.cross(normal / np.linalg.norm(normal), ahead), ahead), slip,
                      wheel.radius * abs(float(turn @ axle)), load, friction, other if mass > 0.0 else None)

    def _speed(self, other: tuple[int, int], place: np.ndarray) -> np.ndarray:
        if other[1] < 0:
            centre = pybullet.getBasePositionAndOrientation(other[0], physicsClientId=self._client)[0]
            linear, angular = pybullet.getBaseVelocity(other[0], physicsClientId=self._client)
        else:
            state = pybullet.getLinkState(*other, computeLinkVelocity=1, physicsClientId=self._client)
            centre, linear, angular = state[0], state[6], state[7]
        return np.array(linear) + np.cross(angular, place - np.array(centre))

    def _stable(self, found: list[_Touch]) -> tuple[float, ...]:
        """(lateral, longitudinal) [m/s/N] from which on forces of the slip are stable in explicit steps: the largest
        speed that one of them, at all wheels together, gives in a step."""
        inertia, least = mass_matrix_of(self._model), []
        for axis in range(2):
            rows = np.stack([touch.axes[axis] @ motion_of_point(self._model, touch.wheel.body, touch.place)
                             for touch in found])
            least.append(self._step_s * float(np.linalg.eigvalsh(rows @ np.linalg.solve(inertia, rows.T))[-1]))
        return tuple(least)

    def _take(self, wheel: Slip, own: tuple[bool, bool]) -> None:
        """Take Bullet's friction away (along the axle, across it) of a wheel, or give it back."""
        axis, near = self._axis(wheel.body)
        if own[0] != own[1] and near < _ALONG:
            own = (False, False)
        if own == self._own[wheel.body]:
            return
        self._own[wheel.body] = own
        along, across = (0.0 if taken else value
                         for taken, value in zip(own, self._friction[wheel.body], strict=True))
        most = max(along, across)
        factors = [across / most if most else 1.0] * 3
        factors[axis] = along / most if most else 1.0
        pybullet.changeDynamics(*self._place(wheel), lateralFriction=most, anisotropicFriction=factors,
                                physicsClientId=self._client)
