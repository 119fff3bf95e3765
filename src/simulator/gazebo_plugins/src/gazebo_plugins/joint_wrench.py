# SPDX-License-Identifier: BSD-3-Clause
"""The force and torque that a joint transmits, fixed joints included, by the balance of momentum. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bullet_sim import BulletSimError
from urdf_model.distance import distance_from
from urdf_model.merge import combine
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from bullet_sim import Model, World
    from urdf_model import Inertial, Robot


class JointWrench:
    """The wrench of the links behind a joint on those before it, in the last step of the world.

    Newton and Euler: the change of the momentum of all links behind the joint equals the sum of their weight, contacts,
    the wrenches of ``Model.apply_wrench``, and the joint's wrench. This also works for fixed joints, which do not exist
    in the physics. In a body that the joint divides, a contact belongs to the link with the nearest shape
    (``urdf_model.distance``).

    :param world: bullet_sim.World
    :param model: bullet_sim.Model, which has a joint of this name in its description
    :param joint: name of a joint of the description, movable or not
    """

    def __init__(self, world: World, model: Model, joint: str) -> None:
        robot = model.robot
        if joint not in robot.joints:
            raise BulletSimError("model '%s' has no joint '%s'; its joints are %s"
                                 % (model.name, joint, ", ".join(robot.joints) or "none"))
        self._world, self._model = world, model
        found = robot.joints[joint]
        #: The link behind the joint.
        self.child = found.child
        #: Pose of the joint in that link's frame (4, 4).
        self.offset = inverse(found.child_offset)
        behind = _links_behind(robot, found.child)
        #: {body: Inertial of its part behind the joint, in the frame of the link it is named after}.
        self._parts: dict[str, Inertial] = {}
        #: {body that the joint divides: all its links}.
        self._divided: dict[str, list[str]] = {}
        self._behind = behind
        for body, merged in model.merged.links.items():
            members = [link for link in merged.members if link in behind]
            if not members:
                continue
            self._parts[body] = _inertial(model, members)
            if len(members) < len(merged.members):
                self._divided[body] = merged.members
        #: (momentum, angular momentum) before the step, of :meth:`note`.
        self._before: tuple[np.ndarray, np.ndarray]

    def note(self) -> None:
        """Call before the step that is to be measured."""
        self._before = self._momentum()

    def measure(self) -> tuple[np.ndarray, np.ndarray]:
        """Call after that step. Returns (force (3,) [N], torque (3,) [Nm] about the joint's origin), in the axes of the
        child link.

        For a weight that hangs on the joint, the force points down.
        """
        frame = self._model.link_pose(self.child).matrix() @ self.offset
        origin = frame[:3, 3]
        before, after = self._before, self._momentum()
        dt = self._world.time_step_s
        change = [(now - then) / dt for now, then in zip(after, before, strict=True)]
        force, torque = self._outside(origin)
        # The joint supplies the missing wrench; the result is the reaction to it.
        force = force - change[0]
        torque = torque - (change[1] - np.cross(origin, change[0]))
        axes = self._model.link_pose(self.child).matrix()[:3, :3]
        return axes.T @ force, axes.T @ torque

    def _momentum(self) -> tuple[np.ndarray, np.ndarray]:
        """Momentum (3,) and angular momentum (3,) about the world's origin of the links behind the joint."""
        total, turning = np.zeros(3), np.zeros(3)
        for centre, inertial, axes, (linear, angular) in self._moving():
            momentum = inertial.mass * linear
            total += momentum
            turning += np.cross(centre, momentum) + axes @ inertial.inertia @ axes.T @ angular
        return total, turning

    def _moving(self):
        """For each part: centre of mass (3,) in the world, Inertial, axes (3, 3), twist of the centre."""
        for body, inertial in self._parts.items():
            pose = self._model.link_pose(body).matrix()
            linear, angular = (np.asarray(values) for values in self._model.link_twist(body))
            arm = pose[:3, :3] @ inertial.centre
            yield pose[:3, 3] + arm, inertial, pose[:3, :3], (linear + np.cross(angular, arm), angular)

    def _outside(self, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force and torque about ``origin`` (3,) of weight, contacts and applied wrenches on the links behind the
        joint."""
        force, torque = np.zeros(3), np.zeros(3)

        def add(push, where, turn=(0.0, 0.0, 0.0)):
            nonlocal force, torque
            push = np.asarray(push, dtype=float)
            force = force + push
            torque = torque + np.cross(np.asarray(where) - origin, push) + turn

        gravity = np.asarray(self._world.gravity)
        for (centre, inertial, _, _), body in zip(self._moving(), self._parts, strict=True):
            if self._model.has_weight(body):
                add(inertial.mass * gravity, centre)
        for body, push, where in contact_forces(self._world, self._model, self._parts):
            if self._is_behind(body, where):
                add(push, where)
        for body, push, turn, where in self._model.pushes():
            if body in self._parts:
                if where is None:
                    # At the centre of the whole body, as PyBullet has it.
                    where = (self._model.link_pose(body).matrix() @ (*self._model.inertial(body).centre, 1.0))[:3]
                if self._is_behind(body, where):
                    add(push, where, turn)
        return force, torque

    def _is_behind(self, body: str, where: Sequence[float] | np.ndarray) -> bool:
        """Whether the point ``where`` (3,) of ``body`` belongs to a link behind the joint."""
        if body not in self._divided:
            return True
        away = {link: _distance(self._model, link, where) for link in self._divided[body]}
        return min(away, key=away.__getitem__) in self._behind


def contact_forces(world: World, model: Model,
                   bodies: Collection[str]) -> list[tuple[str, np.ndarray, Sequence[float]]]:
    """List of (body, force (3,) on it [N], where (3,) [m]) of the last step's contacts on ``bodies`` of ``model``.

    In world axes, friction included. Contacts between two of the bodies are left out.
    """
    found = []
    for contact in world.contacts(model):
        push = contact.force * np.asarray(contact.normal) + np.asarray(contact.friction)
        sides = ((contact.model_a, contact.link_a, push), (contact.model_b, contact.link_b, -push))
        mine = [(link, force, contact.position) for name, link, force in sides if name == model.name and link in bodies]
        if len(mine) == 1:
            found += mine
    return found


def _links_behind(robot: Robot, first: str) -> set[str]:
    """The names (set) of ``first`` and of all links that hang on it."""
    children = {}
    for joint in robot.joints.values():
        children.setdefault(joint.parent, []).append(joint.child)
    behind, waiting = set(), [first]
    while waiting:
        link = waiting.pop()
        behind.add(link)
        waiting += children.get(link, ())
    return behind


def _inertial(model: Model, members: Sequence[str]) -> Inertial:
    """The Inertial of ``members`` of a body together, in the frame of the link that the body is named after."""
    body = model.merged.frames[members[0]].link
    to_frame = inverse(model.merged.frames[body].offset)
    parts = []
    for name in members:
        inertial = model.robot.links[name].inertial
        if inertial is not None:
            place = to_frame @ model.merged.frames[name].offset
            turn = place[:3, :3]
            parts.append((inertial.mass, turn @ inertial.centre + place[:3, 3], turn @ inertial.inertia @ turn.T))
    return combine(parts)


def _distance(model: Model, link: str, where: Sequence[float] | np.ndarray) -> float:
    """How far a point (3,) of the world is from the nearest collision shape of a link [m]."""
    in_link = np.linalg.inv(model.link_pose(link).matrix()) @ (*where, 1.0)
    shapes = model.robot.links[link].collisions
    return min((max(distance_from(shape, in_link[:3]), 0.0) for shape in shapes), default=np.inf)
