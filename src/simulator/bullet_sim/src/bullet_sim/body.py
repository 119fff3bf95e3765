# SPDX-License-Identifier: BSD-3-Clause
"""The links of a model in the world: poses, applied wrenches, masses, contacts."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Inertial, Surface, bounds, gazebo_links
from urdf_model.transforms import inverse

from .builder import directed_bodies, inertial_frame, set_collision_filter
from .errors import BulletSimError, within
from .multibodies import link_indices
from .pose import Pose
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike

    from urdf_model import MergedFrame, MergedLink

    from .builder import Blueprint
    from .multibodies import Multibodies, MultibodyState
    from .world import World

BASE = -1  # PyBullet's index of the root link
_SLOW = 0.01  # slower links keep their velocity, as in ODE [m/s, rad/s]


class Body:
    """A ``Model`` without its joints. SI units, radians, world coordinates."""

    #: For how many checks of ``StateWatch`` the base has not moved.
    still_for = 0

    def __init__(self, client: int, world: World, blueprint: Blueprint, parts: Multibodies,
                 root_offsets: list[np.ndarray]) -> None:
        """``client``: PyBullet's; ``blueprint``: :class:`bullet_sim.builder.Blueprint`; ``parts``, ``root_offsets``:
        what ``builder.build`` returned for it."""
        #: The blueprint that the body is made from; its collision pairs may change.
        self.blueprint = blueprint
        self.name = blueprint.name
        self.robot = blueprint.robot
        self.merged = merged = blueprint.merged
        self.static = blueprint.static
        #: Its multibodies.
        self.parts = parts
        self._client = client
        self._world = world
        self._link_index = link_indices(merged)
        #: Indices of the roots beside the first, and of all roots that move.
        self.loose = tuple(self._link_index[body] for body in merged.loose)
        self.free = self.loose if self.static else (BASE, *self.loose)
        self._offsets = {}
        for body, offset in zip(merged.roots, root_offsets, strict=True):
            self._set_root_offset(self._link_index[body], offset)
        # Pose of a fixed root, cached so that a tick need not ask for it.
        self._base_quaternion = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=client)[1]
        self._link_names = {index: link for link, index in self._link_index.items()}
        #: The links that Gazebo makes of the description: some of `link_names`.
        self.gazebo_links = tuple(dict.fromkeys(gazebo_links(self.robot).values()))
        self._canonical = self._find_canonical()
        self._late_twists = {}  # index of a root -> velocity
        self._late_pushes = []
        self._pushes, self._pushed_at = [], -1  # of the step after `_pushed_at` steps
        self._pairs: tuple[tuple[int, int], ...] = ()
        self._firm = set()  # indices of links with friction that does not creep
        self.set_self_collision_pairs(())
        #: {body's name: parts of its speed and turn rate that each step takes}
        self.decaying = {link.name: link.decay for link in merged.links.values()
                         if any(link.decay) and not (self.static and link.name == merged.root)}
        #: The bodies whose friction depends on the direction, and those of them whose directions turn with them.
        self.directed, self.own_directions = directed_bodies(merged), directed_bodies(merged, own=True)
        self._weightless = {}  # body's name -> (mass, its centre (3,) in the body; None: of the whole body)
        for link in merged.links.values():
            if not link.gravity:
                self.set_weight(link.name, False)
            elif link.weightless is not None and not (self.static and link.name == merged.root):
                self._weightless[link.name] = link.weightless.mass, link.weightless.centre
                world.note_weightless(self, True)

    @property
    def body(self) -> int:
        """PyBullet's number of the multibody that has the root's shape; the only one of most models."""
        return self.parts.bodies[0]

    # -- links --------------------------------------------------------------------------------------------------

    @property
    def link_names(self) -> tuple[str, ...]:
        """The links of the description, including merged ones."""
        return tuple(self.merged.frames)

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link's frame in the world. Raises BulletSimError for an unknown link."""
        return Pose.from_matrix(self._link_matrix(link))

    def body_frame(self, body: str) -> np.ndarray:
        """Return the frame (4, 4) of a body, a link with what is fixed to it, in the world."""
        return self._body_matrix(self._link_index[body])

    def link_twist(self, link: str) -> tuple[np.ndarray, np.ndarray]:
        """Return (linear (3,), angular (3,)) velocity of a link's frame, in world axes [m/s, rad/s]."""
        frame = self._frame(link)
        index = self._link_index[frame.link]
        return self._twist(index, (self._body_matrix(index) @ frame.offset)[:3, 3])

    def base_pose(self) -> Pose:
        """Return the pose of the model's frame in the world; for a URDF that is the root link's."""
        if self._root_is_centre:
            return Pose(*pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client))
        return Pose.from_matrix(self._body_matrix(BASE))

    def set_base_pose(self, pose: Pose) -> None:
        """Put the model's frame at ``pose``, at rest if it is free; joints keep their positions, and loose links their
        places to it."""
        wanted = pose.checked().matrix()
        loose = {}
        if self.loose:
            way = wanted @ inverse(self._body_matrix(BASE))
            loose = {index: way @ self._body_matrix(index) for index in self.loose}
        self._base_quaternion = self._put_root(BASE, wanted)
        for index, frame in loose.items():
            self._put_root(index, frame)
        self._was_placed()

    def loose_poses(self) -> list[Pose]:
        """Return the poses of the frames of the loose bodies, in the order of ``merged.loose``."""
        return [Pose.from_matrix(self._body_matrix(index)) for index in self.loose]

    def root_of(self, link: str) -> str:
        """Return the root of the tree that a link is in, one of ``merged.roots``."""
        return self._link_names[self.parts.root_of(self._link_index[self._frame(link).link])]

    def set_root_pose(self, root: str, pose: Pose) -> None:
        """Put the frame of a free body of ``merged.roots`` at ``pose``, at rest, with the links that joints hold on it,
        but not the other roots."""
        self._put_root(self._link_index[root], pose.checked().matrix())
        self._was_placed()

    def set_root_twist(self, root: str, linear: Sequence[float] | np.ndarray,
                       angular: Sequence[float] | np.ndarray) -> None:
        """Set the velocity of a free body of ``merged.roots`` [m/s, rad/s, world axes]: that of the model's frame for
        the first one, else that of its link's. Raises BulletSimError out of bounds."""
        self._set_root_twist(self._link_index[root], linear, angular)
        self.wake()

    def _put_root(self, index: int, frame: np.ndarray) -> tuple:
        """Put the frame of a root at ``frame`` (4, 4); returns the quaternion that PyBullet has for it."""
        centre = Pose.from_matrix(frame @ self._offsets[index][0])
        self.parts.set_root(index, centre.position, centre.quaternion)
        return centre.quaternion

    def _was_placed(self) -> None:
        self._late_twists = {}
        if self.free:
            self._world.note_placed(self)
        self._world.wake_all()

    def model_pose(self) -> Pose:
        """Return the pose of the model as Gazebo tells it: its frame goes with its first link. That is the pose of
        :meth:`base_pose` but for models that joints hold on the world."""
        if self._canonical is None:
            return self.base_pose()
        link, to_model = self._canonical
        return Pose.from_matrix(self._link_matrix(link) @ to_model)

    def model_twist(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (linear (3,), angular (3,)) velocity of the frame of :meth:`model_pose`, in world axes."""
        if self._canonical is None:
            return self.base_twist()
        link, to_model = self._canonical
        index, matrix = self._link_index[self._frame(link).link], self._link_matrix(link)
        return self._twist(index, (matrix @ to_model)[:3, 3])

    def base_twist(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (linear (3,), angular (3,)) velocity of the model's frame, in world axes."""
        return self._twist(BASE, self._body_matrix(BASE)[:3, 3])

    def set_base_twist(self, linear: Sequence[float] | np.ndarray, angular: Sequence[float] | np.ndarray) -> None:
        """Set the velocity of a free model's frame, in world axes [m/s, rad/s], and as in Gazebo that of each loose
        link. Raises BulletSimError out of bounds."""
        for index in self.free:
            self._set_root_twist(index, linear, angular)
        self.wake()

    def _set_root_twist(self, index: int, linear: Sequence[float] | np.ndarray,
                        angular: Sequence[float] | np.ndarray) -> None:
        within(bounds.SPEED, linear, "the linear velocity")
        angular = np.asarray(within(bounds.TURN_RATE, angular, "the angular velocity"), dtype=float)
        # The frame moves at `linear`; Bullet wants the velocity of the centre of mass.
        arm = self._offsets[index][0][:3, 3]
        if index != BASE:
            arm = arm - self.merged.frames[self._link_names[index]].offset[:3, 3]
        arm = self._body_matrix(index)[:3, :3] @ arm
        at_centre = np.asarray(linear, dtype=float) + np.cross(angular, arm)
        self._late_twists[index] = (at_centre.tolist(), angular.tolist())
        pybullet.resetBaseVelocity(self.parts.places[index].body, *self._late_twists[index],
                                   physicsClientId=self._client)

    def apply_wrench(self, link: str, force: Sequence[float] | np.ndarray,
                     torque: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
                     position: Sequence[float] | np.ndarray | None = None) -> None:
        """Push a link during the next step: ``force`` [N] and ``torque`` [Nm] in world axes.

        The force acts at ``position`` (world, m), by default at the centre of mass of the link's body.
        Raises BulletSimError out of bounds.
        """
        within(bounds.FORCE, force, "the force on link '%s::%s'" % (self.name, link))
        within(bounds.TORQUE, torque, "the torque on link '%s::%s'" % (self.name, link))
        body = self._frame(link).link
        if self._pushed_at != self._world.steps:
            self._pushes, self._pushed_at = [], self._world.steps
        self._pushes.append((body, force, torque, position))
        push = (self._link_index[body], force, torque, position)
        if self.free:
            self._late_pushes.append(push)
        self.wake()
        self._push(*push)

    def pushes(self) -> list[tuple]:
        """Return the wrenches of :meth:`apply_wrench` in the last step: a list of (body, force, torque, position or
        None)."""
        return self._pushes if self._pushed_at == self._world.steps - 1 else []

    def wake(self) -> None:
        """Wake the model up if Bullet has put it to sleep."""
        for index in self.free:
            pybullet.changeDynamics(*self.parts.places[index], physicsClientId=self._client,
                                    activationState=pybullet.ACTIVATION_STATE_WAKE_UP)
        if self.free:
            self._world.note_touched(self)

    def reapply_wrenches(self) -> None:
        """For World, after a step: apply again what was applied to the model while it slept.

        Bullet wakes a body at the end of a step, so the body ignores forces in that step: its velocity is then exactly
        zero.
        """
        twists, self._late_twists = self._late_twists, {}
        pushes, self._late_pushes = self._late_pushes, []
        if not (twists or pushes):
            return
        for index in self.free:
            body = self.parts.places[index].body
            velocity = pybullet.getBaseVelocity(body, physicsClientId=self._client)
            if any(velocity[0]) or any(velocity[1]):
                continue
            if index in twists:
                pybullet.resetBaseVelocity(body, *twists[index], physicsClientId=self._client)
            for push in pushes:
                if self.parts.root_of(push[0]) == index:
                    self._push(*push)

    def contact_force(self, link: str) -> np.ndarray:
        """Return the force (3,) [N, world axes] with which others pressed on a link's body in the last step.

        Without friction.
        """
        total = np.zeros(3)
        index = self._link_index[self._frame(link).link]
        for body, local in self.parts.all_places(index):
            points = pybullet.getContactPoints(bodyA=body, linkIndexA=local, physicsClientId=self._client)
            for point in points or ():
                total += point[9] * np.array(point[7])
        return total

    def grip_firmly(self, link: str) -> None:
        """Make friction at a link's body hold without creeping: by default it creeps by 0.3 mm/s under load."""
        index = self._link_index[self._frame(link).link]
        for place in self.parts.all_places(index):
            pybullet.changeDynamics(*place, frictionAnchor=1, physicsClientId=self._client)
        self._firm.add(index)

    def soften(self, link: str, stiffness: float, damping: float) -> None:
        """Make the surface of a link's body yield in contacts: stiffness [N/m], damping [N s/m]."""
        index = self._link_index[self._frame(link).link]
        for place in self.parts.all_places(index):
            pybullet.changeDynamics(*place, contactStiffness=stiffness, contactDamping=damping,
                                    physicsClientId=self._client)

    def renew_contacts(self, link: str) -> None:
        """Forget the contacts of a link's body; the next step detects them again.

        Bullet keeps contacts from step to step, and sometimes a false one: its normal comes from two nearly parallel
        edges, and it can hold a body that should come free.
        """
        body = self.merged.links[self._frame(link).link]
        surfaces = body.surface, *(patch.surface for patch in body.patches)
        for place, surface in zip(self.parts.all_places(self._link_index[body.name]), surfaces, strict=True):
            set_collision_filter(self._client, place, surface, renew=True)

    # -- mass properties, of bodies: links with what is fixed to them ---------------------------------------------

    def inertial(self, body: str) -> Inertial:
        """Return the urdf_model.Inertial of the body ``body``, in its link's frame. Raises BulletSimError."""
        link = self._body(body)
        offset = self.merged.frames[body].offset
        rotation = offset[:3, :3]
        return Inertial(link.inertial.mass, rotation.T @ (link.inertial.centre - offset[:3, 3]),
                        rotation.T @ link.inertial.inertia @ rotation)

    def set_inertial(self, body: str, mass: float, inertia: ArrayLike, centre: ArrayLike | None = None) -> None:
        """Set mass [kg] and inertia (3, 3) about the centre of mass [kg m^2, axes of the link's frame] of a body, and
        that ``centre`` (3,) [m, link's frame] if it is given.

        The multibody is rebuilt for another centre or other principal axes, which PyBullet sets when it makes the body.
        Raises BulletSimError for a fixed root and for impossible values.
        """
        link = self._body(body)
        index = self._link_index[body]
        if self.static and index == BASE:
            raise BulletSimError("link '%s' of '%s' is fixed in the world; its mass has no effect" % (body, self.name))
        given = np.asarray(inertia, dtype=float)
        if not (math.isfinite(mass) and mass > 0.0):
            raise BulletSimError("a mass of %g kg cannot be set; expected a positive number" % mass)
        within(bounds.MASS, mass, "the mass of link '%s'" % body)
        within(bounds.INERTIA, given.ravel(), "the inertia of link '%s'" % body)
        if mass < bounds.MIN_MASS_KG:
            raise BulletSimError(
                "a mass of %g kg cannot be set; expected at least %g kg" % (mass, bounds.MIN_MASS_KG)
            )
        offset = self.merged.frames[body].offset
        rotation = offset[:3, :3]
        new = Inertial(mass, link.inertial.centre, rotation @ given @ rotation.T)
        if centre is not None:
            new.centre = within(bounds.POSITION, offset[:3, 3] + rotation @ np.asarray(centre, dtype=float),
                                "the centre of mass of link '%s'" % body)
        arguments = {"physicsClientId": self._client}
        place = self.parts.places[index]
        info = pybullet.getDynamicsInfo(*place, **arguments)
        axes = Pose((0.0, 0.0, 0.0), info[4]).matrix()[:3, :3]
        turned = axes.T @ new.inertia @ axes
        moments = np.diag(turned)
        is_turned = np.abs(turned - np.diag(moments)).max() > 1e-3 * moments.max()
        if is_turned:
            moments = np.linalg.eigvalsh(new.inertia)
        if moments.min() <= 0.0:
            raise BulletSimError("the inertia %s has a moment that is not positive" % new.inertia.tolist())
        if moments.min() < bounds.MIN_INERTIA_PER_MASS_M2 * mass:
            raise BulletSimError("the inertia %s has a moment of %g kg m^2; expected at least %g for a mass of %g kg"
                                 % (new.inertia.tolist(), moments.min(), bounds.MIN_INERTIA_PER_MASS_M2 * mass, mass))
        if is_turned or not np.allclose(new.centre, link.inertial.centre, rtol=0.0, atol=1e-9):
            self._rebuild_with(link, new)
        else:
            pybullet.changeDynamics(*place, mass=mass, **arguments)
            # After the mass, which makes PyBullet guess an inertia of its own.
            pybullet.changeDynamics(*place, localInertiaDiagonal=moments.tolist(), **arguments)
            link.inertial = Inertial(mass, link.inertial.centre, new.inertia)
        if not self.has_weight(body):
            self._weightless[body] = mass, None
        self.wake()

    def _rebuild_with(self, link: MergedLink, inertial: Inertial) -> None:
        """Rebuild the multibodies with another inertial of a link; poses and velocities stay."""
        motion, index = self.motion(), self._link_index[link.name]
        link.inertial = inertial
        if index in self.free:
            old, offset = self._offsets[index][0], inertial_frame(link)
            linear, angular = pybullet.getBaseVelocity(self.parts.places[index].body, physicsClientId=self._client)
            frame = self._body_matrix(index)
            # PyBullet's is that of the centre of mass.
            moved = frame[:3, :3] @ (offset[:3, 3] - old[:3, 3])
            twist = np.asarray(linear) + np.cross(angular, moved), angular
            self._set_root_offset(index, offset)
            pose = Pose.from_matrix(frame @ offset)
            base = pose.position, pose.quaternion
            if index == BASE:
                motion = motion._replace(base=base, twist=twist)
            else:
                motion.loose[index] = base, twist
        self._rebuild(motion)

    def motion(self) -> MultibodyState:
        """In Model: the state that it needs to continue the present motion when it is rebuilt."""
        raise NotImplementedError

    def _rebuild(self, motion: MultibodyState | None = None) -> None:
        """In Model: rebuild the multibodies; they go on with ``motion``, by default the present one."""
        raise NotImplementedError

    def _set_root_offset(self, index: int, offset: np.ndarray) -> None:
        self._offsets[index] = offset, inverse(offset)
        if index == BASE:
            self._root_is_centre = bool(np.array_equal(offset, np.eye(4)))

    def has_weight(self, body: str) -> bool:
        """Whether gravity acts on the body ``body``."""
        self._body(body)
        return body not in self._weightless or self._weightless[body][1] is not None

    def set_weight(self, body: str, wanted: bool) -> None:
        """Switch gravity on the body ``body`` on or off."""
        mass = self._body(body).inertial.mass
        self._weightless.pop(body, None)
        if not wanted and not (self.static and body == self.merged.root):
            self._weightless[body] = mass, None
        self._world.note_weightless(self, bool(self._weightless))
        self.wake()

    def cancel_weight(self) -> None:
        """For World: cancel gravity on what is weightless in the next step."""
        gravity = np.array(self._world.gravity)
        for body, (mass, centre) in self._weightless.items():
            index = self._link_index[body]
            place = None if centre is None else (self._body_matrix(index) @ [*centre, 1.0])[:3]
            self._push(index, -mass * gravity, position=place)

    def slow_down(self) -> None:
        """For World: take away what the velocities of links lose in the next step (SDF's <velocity_decay>, as ODE)."""
        dt = self._world.time_step_s
        for body, (linear_part, angular_part) in self.decaying.items():
            index, inertial = self._link_index[body], self.merged.links[body].inertial
            frame = self._body_matrix(index)
            axes = frame[:3, :3]
            linear, angular = self._twist(index, frame[:3, 3] + axes @ inertial.centre)
            force, torque = np.zeros(3), np.zeros(3)
            if np.linalg.norm(linear) > _SLOW:
                force = -linear_part * inertial.mass / dt * linear
            if np.linalg.norm(angular) > _SLOW:
                torque = -angular_part / dt * (axes @ inertial.inertia @ axes.T @ angular)
            self._push(index, force, torque)

    # -- collisions ---------------------------------------------------------------------------------------------

    def set_self_collision_pairs(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Let exactly these ``pairs`` of links collide with each other; at the start none do, as in Gazebo.

        Two links with one joint between them never collide."""
        wanted = set()
        for pair in pairs:
            a, b = (self._link_index[self._frame(link).link] for link in pair)
            if a != b:
                wanted.add((min(a, b), max(a, b)))
        self._pairs = tuple(sorted(wanted))
        if wanted and not self.blueprint.self_collision:
            self.blueprint = self.blueprint._replace(self_collision=True)
            self._rebuild()
            return
        if not self.blueprint.self_collision and len(self.parts.bodies) == 1:
            return
        links = sorted(self._link_names)
        for i, a in enumerate(links):
            for b in links[i + 1 :]:
                for one, other in itertools.product(self.parts.all_places(a), self.parts.all_places(b)):
                    pybullet.setCollisionFilterPair(one.body, other.body, one.index, other.index, int((a, b) in wanted),
                                                    physicsClientId=self._client)
            own = self.parts.all_places(a)
            for one, other in itertools.combinations(own, 2):
                pybullet.setCollisionFilterPair(one.body, other.body, one.index, other.index, 0,
                                                physicsClientId=self._client)

    def link_name(self, body: int, index: int) -> str:
        """Return the merged name of the link that PyBullet numbers ``index`` (-1 is the root) in the multibody
        ``body``."""
        return self._link_names[self.parts.index(body, index)]

    def surface(self, body: int, index: int) -> Surface:
        """The urdf_model.Surface of the link that PyBullet numbers ``index`` in the multibody ``body``."""
        number = self.parts.index(body, index)
        link = self.merged.links[self._link_names[number]]
        place = self.parts.all_places(number).index((body, index)) if index >= 0 else 0
        return (link.patches[place - 1].surface if place else link.surface) or Surface()

    def frame_of(self, motion: MultibodyState) -> Pose:
        """For World: the pose of the model's frame in what ``Model.motion`` or ``Model.last_good`` returned."""
        return Pose.from_matrix(Pose(*motion.base).matrix() @ self._offsets[BASE][1])

    def _restore_collisions(self) -> None:
        """For Model: set the collision pairs and the firm friction again on a rebuilt body."""
        self.set_self_collision_pairs([(self._link_names[a], self._link_names[b]) for a, b in self._pairs])
        for place in (place for index in self._firm for place in self.parts.all_places(index)):
            pybullet.changeDynamics(*place, frictionAnchor=1, physicsClientId=self._client)

    # -- inside -------------------------------------------------------------------------------------------------

    def _frame(self, link: str) -> MergedFrame:
        try:
            return self.merged.frames[link]
        except KeyError:
            raise BulletSimError(
                "model '%s' has no link '%s'; its links are %s" % (self.name, link, ", ".join(self.link_names))
            ) from None

    def _body(self, body: str) -> MergedLink:
        """Return the MergedLink ``body``; raises BulletSimError, which names the body for a link that was merged."""
        if body not in self.merged.links:
            frame = self._frame(body)
            raise BulletSimError("link '%s' of '%s' is fixed to link '%s' and has its mass there; ask for that one"
                                 % (body, self.name, frame.link))
        return self.merged.links[body]

    def _find_canonical(self) -> tuple[str, np.ndarray] | None:
        """(Gazebo's first link, the model's frame in its (4, 4)) where joints carry it, or None; before any joint has
        moved."""
        first = next(iter(self.gazebo_links), self.merged.root)
        if self.merged.frames[first].link == self.merged.root:
            return None
        return first, inverse(self._link_matrix(first)) @ self._body_matrix(BASE)

    def _link_matrix(self, link: str) -> np.ndarray:
        frame = self._frame(link)
        return self._body_matrix(self._link_index[frame.link]) @ frame.offset

    def _body_matrix(self, index: int) -> np.ndarray:
        if index < 0:
            body = self.parts.places[index].body
            centre = Pose(*pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client))
            return centre.matrix() @ self._offsets[index][1]
        state = pybullet.getLinkState(*self.parts.places[index], computeForwardKinematics=1,
                                      physicsClientId=self._client)
        return Pose(state[4], state[5]).matrix()

    def _twist(self, index: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (linear, angular) velocity of ``point`` (3,) (world) of a body, in world axes."""
        if index < 0:
            body = self.parts.places[index].body
            linear, angular = map(np.array, pybullet.getBaseVelocity(body, physicsClientId=self._client))
            centre = np.array(pybullet.getBasePositionAndOrientation(body, physicsClientId=self._client)[0])
        else:
            state = pybullet.getLinkState(*self.parts.places[index], computeLinkVelocity=1,
                                          physicsClientId=self._client)
            centre, linear, angular = np.array(state[0]), np.array(state[6]), np.array(state[7])
        return linear + np.cross(angular, point - centre), angular

    def _push(self, index: int, force: Sequence[float] | np.ndarray,
              torque: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
              position: Sequence[float] | np.ndarray | None = None) -> None:
        place, point = self.parts.places[index], position
        if point is None:
            if index < 0:
                point = pybullet.getBasePositionAndOrientation(place.body, physicsClientId=self._client)[0]
            else:
                point = pybullet.getLinkState(*place, physicsClientId=self._client)[0]
        arguments = {"flags": pybullet.WORLD_FRAME, "physicsClientId": self._client}
        pybullet.applyExternalForce(*place, list(force), list(point), **arguments)
        if any(torque):
            pybullet.applyExternalTorque(*place, list(torque), **arguments)
