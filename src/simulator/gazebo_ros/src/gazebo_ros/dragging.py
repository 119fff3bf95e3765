# SPDX-License-Identifier: BSD-3-Clause
"""Links that are pulled by a spring, as with a mouse. ROS-free; wall times are arguments."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from urdf_model import bounds

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from bullet_sim import Model

#: A link is let go when nobody has asked for it this long [s, wall].
FORGET_S = 0.5
# The spring moves the model like a mass on a critically damped spring of this frequency [rad/s]; under its own weight
# the model then hangs 4 cm below the target.
_FREQUENCY = 15.0
# The largest acceleration that the spring gives the model [m/s^2].
_MAX_ACCELERATION = 60.0
# A model that is fixed in the world is pulled as if it had this mass at most [kg]: by at most 200 N, as by a person.
_FIXED_KG = 3.5
# In one step, damping and spring change the velocity of the link alone by at most about these shares: more would make
# light links swing up.
_DAMPING_SHARE, _SPRING_SHARE = 0.25, 0.1
# How quickly a hanging thing stops turning [1/s].
_TURN_DAMPING = 5.0


class Masses(NamedTuple):
    """``model``: the mass that the spring moves; ``grip``: the least mass that the link alone has for a force at the
    grip [kg]; ``inertia`` (3, 3): the link's, about the grip [kg m^2, world axes]; ``own_share``: the part of it that
    the link has about its centre of mass."""

    model: float
    grip: float
    inertia: np.ndarray
    own_share: float


class Drag(NamedTuple):
    """``grip`` (3,) in the link's frame, ``target`` (3,) in the world [m]; ``asked_s``: when [s, wall]."""

    grip: np.ndarray
    target: np.ndarray
    asked_s: float


def masses_of(model: Model, link: str, grip: np.ndarray) -> Masses:
    """The :class:`Masses` for a pull at the point ``grip`` (3,) [m, world] of a link of a ``bullet_sim.Model``."""
    merged = model.merged
    name = merged.frames[link].link
    inertial, pose = merged.links[name].inertial, model.link_pose(name).matrix()
    arm = grip - (pose @ [*inertial.centre, 1.0])[:3]
    inertia = pose[:3, :3] @ inertial.inertia @ pose[:3, :3].T
    across = np.cross(np.eye(3), arm)
    # The velocity at the grip per impulse there, of a free body.
    mobility = np.eye(3) / inertial.mass + across.T @ np.linalg.solve(inertia, across)
    moving = sum(other.inertial.mass for other in merged.links.values()
                 if not (model.static and other.name == merged.root))
    own, swung = float(np.trace(inertia)), 3.0 * inertial.mass * float(arm @ arm)
    return Masses(min(moving, _FIXED_KG) if model.static else moving, 1.0 / float(np.linalg.eigvalsh(mobility)[-1]),
                  inertia * (1.0 + swung / own), own / (own + swung))


def spring_wrench(masses: Masses, away: npt.ArrayLike, velocity: npt.ArrayLike, turn_rate: npt.ArrayLike,
                  step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """(force (3,) [N] at the grip, torque (3,) [Nm]) of the spring, in world axes.

    ``away``: from the grip to the target (3,) [m]; ``velocity`` (3,) of the grip [m/s]; ``turn_rate`` (3,) of the link
    [rad/s]; ``step_s``: length of a tick [s].
    """
    stiffness = min(masses.model * _FREQUENCY ** 2, _SPRING_SHARE * masses.grip / step_s ** 2)
    damping = min(2.0 * masses.model * _FREQUENCY, _DAMPING_SHARE * masses.grip / step_s)
    force = stiffness * np.asarray(away) - damping * np.asarray(velocity)
    size, most = float(np.linalg.norm(force)), min(masses.model * _MAX_ACCELERATION, bounds.FORCE.high)
    if size > most:
        force = force * (most / size)
    return force, -min(_TURN_DAMPING, _DAMPING_SHARE * masses.own_share / step_s) * (masses.inertia @ turn_rate)


class Drags:
    """The pulls of now, by (model, link)."""

    def __init__(self) -> None:
        self._drags = {}

    def __len__(self) -> int:
        return len(self._drags)

    def __contains__(self, target: object) -> bool:
        return target in self._drags

    def ask(self, target: tuple[str, str], drag: Drag) -> None:
        """Pull ``target``, (model's name, link), by a :class:`Drag`; it replaces the one before."""
        self._drags[target] = drag

    def remove(self, concerns: Callable[[tuple[str, str]], bool]) -> None:
        """End the pulls of the targets with ``concerns(target)`` true."""
        self._drags = {target: drag for target, drag in self._drags.items() if not concerns(target)}

    def due(self, now_s: float) -> list[tuple[tuple[str, str], Drag]]:
        """[(target, :class:`Drag`)] of the pulls that somebody still asks for at ``now_s`` [s, wall]."""
        self.remove(lambda target: not now_s - self._drags[target].asked_s < FORGET_S)
        return list(self._drags.items())


def push(model: Model, link: str, drag: Drag, step_s: float) -> None:
    """Apply a pull to ``link`` of a ``bullet_sim.Model`` in the next step of ``step_s`` [s]."""
    pose = model.link_pose(link).matrix()
    arm = pose[:3, :3] @ drag.grip
    grip = pose[:3, 3] + arm
    linear, angular = model.link_twist(link)
    force, torque = spring_wrench(masses_of(model, link, grip), drag.target - grip, linear + np.cross(angular, arm),
                                  angular, step_s)
    if math.isfinite(float(force @ force)):
        model.apply_wrench(link, force.tolist(), torque.tolist(), grip.tolist())
