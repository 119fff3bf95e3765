# SPDX-License-Identifier: BSD-3-Clause
"""The world: one PyBullet client, its models, its time."""

from __future__ import annotations

import itertools
import os
from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Link, Mesh, OutOfBounds, Plane, Robot, Shape, bounds, check_robot, merge_fixed

from .builder import Blueprint, build, is_wheel, join_patches, link_collisions
from .contact import ContactPoint
from .errors import LOG, BulletSimError, within
from .hanging import Hanging
from .model import Model
from .overlaps import come_out
from .pose import Pose
from .quiet_pybullet import pybullet
from .shapes import MeshCache, MeshFiles, ShapeStore
from .sliding_wheels import sliding_wheels
from .slipping_wheels import SlippingWheels
from .stand_ins import with_stand_ins
from .state_watch import StateWatch
from .world_directions import WorldDirections

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from urdf_model import MergedLink, MergedRobot

    from .body import Body
    from .multibodies import MultibodyState
    from .sliding_wheels import SlidingWheels
    from .slipping_wheels import Slip

# Of Bullet's constraint solver, at the start. `model.POSITION_GAIN` is chosen for it.
SOLVER_ITERATIONS = 20
# Bullet ends the iterations early where all of them change speeds by less than the root of this [m/s]. With its own
# 1e-7, friction lets free bodies creep by 0.3 mm/s. A world without free bodies keeps that: driven joints take all
# iterations.
_CREEP_M2_PER_S2 = {True: 1e-9, False: 1e-7}


def plain_path(uri: str) -> str | None:
    """Return the file that ``uri`` (a path or file://…) names, or None: for a world without packages, whose
    meshes others find (``model_files.resources.ResourceFinder``)."""
    path = uri[len("file://") :] if uri.startswith("file://") else uri
    return path if os.path.isfile(path) else None


def is_fixed(root: str, static: bool | None = None) -> bool:
    """Whether a robot with this root link is fixed in the world; ``static``: as for ``World.spawn``."""
    return root == "world" if static is None else static


def self_colliding(merged: MergedRobot) -> list[tuple[str, str]]:
    """The pairs of links of a urdf_model.MergedRobot that collide with each other: both of them ask for it."""
    links = [link.name for link in merged.links.values() if link.self_collide and link.collisions]
    joined = {frozenset((joint.parent, joint.child)) for joint in merged.joints.values()}
    return [pair for pair in itertools.combinations(links, 2) if frozenset(pair) not in joined]


def _has_mesh(link: Link | MergedLink | None) -> bool:
    """Whether a link does not exist, or has a collision mesh."""
    return link is None or any(isinstance(shape.geometry, Mesh) for shape in link.collisions)


class World:
    """A physics world that steps in fixed ticks of ``time_step_s``.

    Every call, from the constructor to ``close``, belongs to one thread. The same calls in the same order give the same
    numbers, bit for bit, in every fresh world on one machine.

    :param time_step_s: length of a tick [s]
    :param gravity: (3,) [m/s^2]
    :param contact_ahead_m: distance below which two bodies get a contact, before they touch [m]. The default is the
        distance that 2 m/s travel in a tick of 2 ms; with Bullet's default of 0.02 m, a folded arm beside its body
        costs time for contacts that never happen. For small bodies it is at most a fiftieth of their size.
    :param seed: of ``World.random``, for noise
    :param find_mesh: function from a mesh URI to a file path, or None when there is no such file
    :param warn: function of one line of text, called after a repair, as where a box replaces a mesh that
        ``find_mesh`` does not find; the default prints it
    :param error: function of one line of text, called for a model that got an impossible state
    """

    _contact_ahead_in_force_m = None

    def __init__(self, time_step_s: float = 0.002, gravity: Iterable[float] = (0.0, 0.0, -9.81), seed: int = 0,
                 contact_ahead_m: float = 0.004, find_mesh: Callable[[str], str | None] = plain_path,
                 warn: Callable[[str], None] = LOG.warning, error: Callable[[str], None] = LOG.error) -> None:
        self.time_step_s = within(bounds.TIME_STEP, time_step_s, "the time step")
        self._step_since = 0, 0.0  # the tick and the time [s] that the present length of a tick counts from
        self.solver_iterations = SOLVER_ITERATIONS
        self.tick = 0
        #: Number of steps since the start; a reset of the time does not reset it.
        self.steps = 0
        self.models: dict[str, Model] = {}
        self.random = np.random.default_rng(seed)
        self._warn = warn
        self._client: int = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise BulletSimError("PyBullet gave no physics client; are too many worlds open in this process?")
        #: MeshFiles, which any thread may ask.
        self.mesh_files = MeshFiles(find_mesh, MeshCache(warn=warn))
        self._shapes = ShapeStore(self._client, self.mesh_files)
        self._weightless: list[Body] = []  # models of which some link has no weight
        self._sliding: dict[Model, list[SlidingWheels]] = {}
        self._slipping: dict[Model, list[SlippingWheels]] = {}
        self._directions: dict[Model, WorldDirections] = {}
        self._acting: dict[Model, list[Callable[[], None]]] = {}  # functions that act on it before each step
        self._watch = StateWatch(self, error)
        self._touched: list[Body] = []  # models that were touched since the last step, perhaps asleep
        self._placed: list[Body] = []  # free models that were put somewhere since the last step
        self._things_are_last = True  # free models without joints, for Bullet; not so after others were spawned
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=time_step_s,
            numSolverIterations=self.solver_iterations,
            numSubSteps=0,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        self._contact_ahead_m = contact_ahead_m
        self._put_contact_ahead()
        self.set_gravity(gravity)

    @property
    def time_s(self) -> float:
        """Simulation time [s]."""
        tick, time_s = self._step_since
        return time_s + (self.tick - tick) * self.time_step_s

    @property
    def gravity(self) -> tuple[float, ...]:
        """Gravity (3,) [m/s^2]."""
        return self._gravity

    def set_gravity(self, gravity: Iterable[float]) -> None:
        """Set gravity (3,) [m/s^2]. Raises BulletSimError unless it is three numbers within bounds."""
        gravity = tuple(float(g) for g in gravity)
        if len(gravity) != 3:
            raise BulletSimError("gravity is three numbers, found %s" % (gravity,))
        within(bounds.GRAVITY, gravity, "gravity")
        pybullet.setGravity(*gravity, physicsClientId=self._client)
        self._gravity = gravity
        self.wake_all()

    def set_solver_iterations(self, iterations: int) -> None:
        """Set the iterations of Bullet's constraint solver (``bounds.SOLVER_ITERATIONS``). Raises BulletSimError."""
        within(bounds.SOLVER_ITERATIONS, iterations, "the number of solver iterations")
        pybullet.setPhysicsEngineParameter(numSolverIterations=iterations, physicsClientId=self._client)
        self.solver_iterations = iterations

    def set_time_step(self, time_step_s: float) -> None:
        """Set the length of a tick from the next one on [s]; the time is kept.

        Raises BulletSimError out of bounds.
        """
        within(bounds.TIME_STEP, time_step_s, "the time step")
        self._step_since = self.tick, self.time_s
        self.time_step_s = time_step_s
        pybullet.setPhysicsEngineParameter(fixedTimeStep=time_step_s, physicsClientId=self._client)
        for model in self.models.values():
            model.step_changed()
        for slipping in itertools.chain(*self._slipping.values()):
            slipping.step_changed(time_step_s)

    def renew_contacts(self, model: Body | None = None, links: Iterable[str] = ()) -> None:
        """Forget the contacts of ``links`` of a model, by default those of all that moves; the next step detects them
        again.

        Bullet has the two bodies of a contact in the order in which it came to know of them, and the forces depend on
        it: with a box before the fingers, 82 of 100 grasps ended well, with the fingers before the box 95. So free
        things without joints always come last, whatever was spawned or renewed.
        """
        if model is None:
            for one in self.models.values():
                if one.joint_names:
                    _renew(one)
        else:
            for link in links:
                model.renew_contacts(link)
        self._renew_things()

    def _renew_things(self) -> None:
        self._things_are_last = True
        for model in self.models.values():
            if not (model.joint_names or model.static):
                _renew(model)

    def wake_all(self) -> None:
        """Wake all sleeping bodies: Bullet does not notice changes from outside."""
        for model in self.models.values():
            model.wake()

    def spawn(self, robot: Robot, name: str, pose: Pose | None = None, static: bool | None = None,
              self_collision_pairs: Collection[tuple[str, str]] = (),
              mesh_cuts: dict[str, tuple[tuple, ...]] | None = None, merged: MergedRobot | None = None) -> Model:
        """Put ``robot`` (urdf_model.Robot) into the world as ``name``, its frame at ``pose``; return its Model.

        The frame of a robot from a URDF is that of its root link. ``warn`` is called with the replacements of
        missing meshes. ``static`` fixes the root and links without a joint; by default only a robot whose root
        link is called "world" is fixed, as in Gazebo. ``self_collision_pairs``: as for
        ``Model.set_self_collision_pairs``; by default those that the description asks for, but for meshes that
        overlap at the start. ``mesh_cuts``: {link: planes}, as for ``convex_parts.cut``, in the mesh's axes
        [m], cuts the collision meshes of those links and replaces them by the convex hulls of the parts. If
        such a mesh is missing, the pairs of its body are left out: its replacement is too rough for a folded
        arm. ``merged``: the MergedRobot of ``robot``, which must be checked and have no missing mesh; so the
        slow work can be done before, in another thread. Raises BulletSimError when the name is taken or empty,
        and for numbers out of bounds.
        """
        if not name:
            raise BulletSimError("a model needs a name")
        if name in self.models:
            raise BulletSimError("model '%s' exists already; delete it first or choose another name" % name)
        pose = (pose or Pose()).checked()
        held, static = bool(static), is_fixed(robot.root, static)
        if merged is None:
            try:
                check_robot(robot)
            except OutOfBounds as error:
                raise BulletSimError("model '%s': %s" % (name, error)) from None
            robot, mended = with_stand_ins(robot, self.mesh_files)
            if mended:
                self._warn("model '%s': %s" % (name, mended))
            merged = merge_fixed(robot, held=held)
        crowded = join_patches(merged)
        if crowded:
            self._warn("model '%s': Bullet has no room for all different surfaces of link %s; the rest of the shapes "
                       "has the first one" % (name, ", ".join("'%s'" % link for link in crowded)))
        rough = {merged.frames[link].link for link in mesh_cuts or () if not _has_mesh(robot.links.get(link))}
        asked = list(self_collision_pairs) or self_colliding(merged)
        pairs = [pair for pair in asked if all(merged.frames[link].link not in rough for link in pair)]
        blueprint = Blueprint(name, robot, merged, static, mesh_cuts, bool(pairs), in_limbs=not merged.loops)
        parts, root_offsets = build(self._client, blueprint, pose, self._shapes,
                                   lambda text: self._warn("model '%s': %s" % (name, text)))
        model = Model(self._client, self, blueprint, parts, root_offsets)
        if pairs:
            model.set_self_collision_pairs(pairs)
        self.models[name] = model
        for gear in merged.gears:
            joint, other = model.index([gear.joint, gear.other]).tolist()
            model.couple(joint, other, gear.ratio)
        if pairs and not self_collision_pairs:
            self._part_rough_pairs(model, pairs)
        if model.free:
            self.note_placed(model)
        wheels = [] if static else sliding_wheels(self._client, model)
        if wheels:
            self._sliding[model] = wheels
        directions = WorldDirections(self._client, model)
        if directions:
            self._directions[model] = directions
        if model.decaying:
            self._acting[model] = [model.slow_down]
        if model.springs is not None:
            self._acting.setdefault(model, []).append(model.springs.push)
            for joint, stiffness in model.springs.bounded().items():
                self._warn("model '%s': the spring of joint '%s' has a stiffness of %g; %g is used, which is stable at "
                           "a step of %g s" % (name, joint, *stiffness, self.time_step_s))
        self._models_changed()
        self._things_are_last = self._things_are_last and not (model.joint_names or model.static)
        return model

    def _part_rough_pairs(self, model: Model, pairs: Iterable[tuple[str, str]]) -> None:
        """Let links of ``model`` that overlap now not collide where one has a mesh: its convex hull is larger."""
        links = model.merged.links
        overlapping = {frozenset((contact.link_a, contact.link_b)) for contact in self.touching(model)
                       if contact.model_a == contact.model_b and contact.distance < 0.0
                       and (_has_mesh(links[contact.link_a]) or _has_mesh(links[contact.link_b]))}
        if overlapping:
            model.set_self_collision_pairs([pair for pair in pairs if frozenset(pair) not in overlapping])
            self._warn("model '%s': these links do not collide with each other, since their convex hulls overlap: "
                       "%s" % (model.name, ", ".join(sorted(" and ".join(sorted(pair)) for pair in overlapping))))

    def make_shape(self, merged: MergedRobot, link: str, static: bool | None = None,
                   mesh_cuts: dict[str, tuple[tuple, ...]] | None = None) -> None:
        """Make the collision shape of a body of ``merged`` (urdf_model.MergedRobot) beforehand.

        A shape takes up to 20 ms; this spreads a robot's shapes over several ticks. ``static``, ``mesh_cuts``: as for
        :meth:`spawn`.
        """
        static = is_fixed(merged.root, static)
        exact = any(joint.child == link and is_wheel(joint) for joint in merged.joints.values())
        self._shapes.compound(link_collisions(merged, link, static), static and link == merged.root, mesh_cuts, exact)

    def hang(self, model: Model, link: str, most_n: float) -> Hanging:
        """Hold a link of a free Model where it is, with a force [N] at most; returns the :class:`.hanging.Hanging` that
        moves it and lets it go. Raises BulletSimError for an unknown link."""
        return Hanging(self._client, model, link, most_n)

    def let_slip(self, model: Model, wheels: Sequence[Slip]) -> SlippingWheels:
        """Let the contacts of ``wheels`` of a Model slip (:mod:`.slipping_wheels`); returns the
        :class:`.slipping_wheels.SlippingWheels`. Raises BulletSimError for a body that is no wheel."""
        slipping = SlippingWheels(self._client, model, wheels, self.time_step_s)
        if slipping.crooked:
            self._warn("model '%s': wheels %s slip along both axes or not at all, since their axles are no axes of "
                       "their inertia" % (model.name, ", ".join(slipping.crooked)))
        self._slipping.setdefault(model, []).append(slipping)
        bodies = {wheel.body for wheel in wheels}
        model.directed |= bodies
        model.own_directions |= bodies
        if model in self._directions:
            self._directions[model].leave(bodies)
        if model in self._sliding:
            self._sliding[model] = sliding_wheels(self._client, model)
        self._models_changed()
        return slipping

    def end_slip(self, slipping: SlippingWheels) -> None:
        """Give the contacts of what :meth:`let_slip` returned back to Bullet's friction."""
        for model, found in list(self._slipping.items()):
            if slipping in found:
                slipping.end()
                self._slipping[model] = [other for other in found if other is not slipping]

    def add_ground_plane(self, name: str = "ground_plane") -> Model:
        """Add the half space below z = 0; return its Model (one link, "link", as Gazebo's has)."""
        link = Link("link", collisions=[Shape(Plane(), np.eye(4), "collision", None, "link")])
        return self.spawn(Robot(name, {"link": link}, {}, "link", keeps_links=True), name, static=True)

    def delete(self, name: str) -> None:
        """Remove a model. Raises BulletSimError when there is none of that name."""
        model = self._model(name)
        model.remove()
        del self.models[name]
        self._sliding.pop(model, None)
        self._slipping.pop(model, None)
        self._directions.pop(model, None)
        self._acting.pop(model, None)
        self._models_changed()
        self.note_weightless(model, False)
        self._touched = [other for other in self._touched if other is not model]
        self._placed = [other for other in self._placed if other is not model]
        # Bodies that stood on it must fall.
        self.wake_all()

    def _models_changed(self) -> None:
        any_free = any(model.free for model in self.models.values())
        # Bullet's cone of friction fails where a coefficient is 0; without it, friction is a pyramid, as Gazebo's.
        pyramid = any(model.directed for model in self.models.values())
        pybullet.setPhysicsEngineParameter(solverResidualThreshold=_CREEP_M2_PER_S2[any_free],
                                           enableConeFriction=int(not pyramid), physicsClientId=self._client)
        self._watch.models_changed()
        for groups in self._sliding.values():
            for wheels in groups:
                wheels.models_changed()

    def note_weightless(self, model: Body, wanted: bool) -> None:
        """For Model: whether ``model`` has links whose weight must be taken away at each step."""
        self._weightless = [other for other in self._weightless if other is not model] + [model] * wanted

    def note_touched(self, model: Body) -> None:
        """For Model: something was done to ``model``, which may be asleep."""
        if model not in self._touched:
            self._touched.append(model)
        self._watch.note_touched(model)

    def note_placed(self, model: Body) -> None:
        """For Model: ``model``, which is free, was put somewhere; the next step moves it out of what it overlaps."""
        if model not in self._placed:
            self._placed.append(model)

    def _put_contact_ahead(self) -> None:
        """PyBullet has one value for all worlds of a process: set ours again if another world changed it."""
        if World._contact_ahead_in_force_m != self._contact_ahead_m:
            World._contact_ahead_in_force_m = self._contact_ahead_m
            pybullet.setPhysicsEngineParameter(
                contactBreakingThreshold=self._contact_ahead_m, physicsClientId=self._client
            )

    def step(self) -> None:
        """Advance the world by one tick."""
        self._put_contact_ahead()
        if not self._things_are_last:
            self._renew_things()
        if self._placed:
            placed, self._placed = self._placed, []
            for model in placed:
                others = [other for other in self.models.values() if other is not model]
                for index in model.free:
                    come_out(self._client, model, index, others, self._gravity)
        for model in self._weightless:
            model.cancel_weight()
        for groups in self._sliding.values():
            for wheels in groups:
                wheels.correct()
        for found in self._slipping.values():
            for slipping in found:
                slipping.push()
        for directions in self._directions.values():
            directions.follow()
        for functions in self._acting.values():
            for act in functions:
                act()
        pybullet.stepSimulation(physicsClientId=self._client)
        self.tick += 1
        self.steps += 1
        if self._touched:
            touched, self._touched = self._touched, []
            for model in touched:
                model.reapply_wrenches()
        self._watch.look()

    def rebuild(self, models: Collection[Model], motions: Mapping[Model, MultibodyState] | None = None) -> None:
        """Rebuild the multibodies of ``models``.

        ``motions``: {model: result of ``Model.motion`` or ``Model.last_good``}. All bodies are removed before the first
        one is built, so that Bullet's search tree is empty in between.
        """
        motions = {model: (motions or {}).get(model) or model.motion() for model in models}
        for model in models:
            model.remove()
        for model, motion in motions.items():
            parts, _ = build(self._client, model.blueprint, model.frame_of(motion), self._shapes, lambda text: None)
            model.take_parts(parts, motion)
        self._things_are_last = False
        self.wake_all()

    def reset_models(self) -> None:
        """Return every model to its marked start. Time goes on."""
        for model in self.models.values():
            model.reset()

    def reset_time(self) -> None:
        """Begin again at tick 0."""
        self.tick = 0
        self._step_since = 0, 0.0

    def detect_contacts(self) -> None:
        """Find the contacts at the present poses, without a step; ``contacts`` then returns them."""
        self._put_contact_ahead()
        pybullet.performCollisionDetection(physicsClientId=self._client)

    def contacts(self, model: Model | None = None, other: Model | None = None) -> list[ContactPoint]:
        """Return the contacts of the last step as a list of ContactPoint; all, or those of one Model, or between
        two."""
        if model is None:
            points = pybullet.getContactPoints(physicsClientId=self._client) or ()
        else:
            points = model.parts.contacts(None if other is None else other.parts)
        names = self._models_by_body() if points else {}
        found = []
        for point in points:
            a, b = names[point[1]], names[point[2]]
            found.append(
                ContactPoint(
                    a.name, a.link_name(point[1], point[3]), b.name, b.link_name(point[2], point[4]),
                    point[5], point[7], point[8], point[9],
                    tuple(point[10] * u + point[12] * v for u, v in zip(point[11], point[13], strict=True)),
                )
            )
        return found

    def touching(self, model: Model) -> list[ContactPoint]:
        """Return the contacts of ``model`` at the present poses, as :meth:`contacts` does; no time passes."""
        self.detect_contacts()
        return self.contacts(model)

    def ray_test_batch(self, starts: ArrayLike, ends: ArrayLike) -> np.ndarray:
        """Cast rays from ``starts`` (k, 3) to ``ends`` (k, 3) [m, world]; return the fractions (k,) at which they hit.

        1.0 if a ray hits nothing.
        """
        starts, ends = np.asarray(starts, dtype=float), np.asarray(ends, dtype=float)
        hits = pybullet.rayTestBatch(starts.tolist(), ends.tolist(), physicsClientId=self._client)
        return np.array([hit[2] if hit[0] >= 0 else 1.0 for hit in hits])

    def first_hits(self, starts: Iterable[Sequence[float]],
                   ends: Iterable[Sequence[float]]) -> list[tuple[str, str] | None]:
        """Cast rays as ``ray_test_batch`` does; return for each its first hit: ``(model's name, link's merged name)``,
        or None.

        A ray that starts inside a convex shape does not hit that shape.
        """
        models = self._models_by_body()
        hits = pybullet.rayTestBatch(list(starts), list(ends), physicsClientId=self._client)
        found = ((models.get(hit[0]), hit) for hit in hits)
        return [None if model is None else (model.name, model.link_name(*hit[:2])) for model, hit in found]

    def close(self) -> None:
        """Disconnect the physics client. The world cannot be used afterwards."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1
            self.models = {}

    def _models_by_body(self) -> dict[int, Model]:
        return {body: model for model in self.models.values() for body in model.parts.bodies}

    def _model(self, name: str) -> Model:
        try:
            return self.models[name]
        except KeyError:
            known = ", ".join(self.models) or "none"
            raise BulletSimError("there is no model '%s'; models: %s" % (name, known)) from None


def _renew(model: Body) -> None:
    for name, link in model.merged.links.items():
        if link.collisions:
            model.renew_contacts(name)
