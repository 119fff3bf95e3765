# SPDX-License-Identifier: BSD-3-Clause
"""Turn a merged robot into PyBullet multibodies, mostly one (:mod:`bullet_sim.multibodies`).

A body is made with ``createMultiBody`` instead of ``loadURDF``: no temporary file, collision shapes shared between
copies, the inertia exactly as merged, and 10 ms where loading the same robot from a file takes 60.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from urdf_model import Cylinder, MergedRobot, Robot, Sphere, Surface, SurfacePatch, bounds
from urdf_model.model import ALL_BITS
from urdf_model.transforms import quaternion_from_matrix, rigid

from .directions import directed, is_off, scales, turned
from .mass_matrix import moving_inertial
from .multibodies import LinkPlace, Multibodies, limbs, patches
from .pose import Pose
from .quiet_pybullet import pybullet
from .shapes import NO_SHAPE

if TYPE_CHECKING:
    from collections.abc import Callable

    from urdf_model import Joint, MergedLink, Shape

    from .multibodies import Multibody
    from .shapes import ShapeStore

_JOINT_TYPES = {
    "revolute": pybullet.JOINT_REVOLUTE,
    "continuous": pybullet.JOINT_REVOLUTE,
    "prismatic": pybullet.JOINT_PRISMATIC,
}
# Gazebo's defaults of a collision without <surface>: friction, and the damping of a contact [N s/m].
_DEFAULT_FRICTION = 1.0
# Largest friction of a wheel, a link on a continuous joint. Bullet takes no more than this.
_WHEEL_FRICTION = 10.0
_DEFAULT_DAMPING = 1.0
# Casters, spheres beside the wheels, and the edges of wheels are smaller by this [m], and by at most this part. Where
# all touch the floor at the same height, the shares of the load are undetermined. Bullet gave casters up to 0.6 of it
# at steps of 10 ms, and with a friction of 1 they held the vehicle; and it put all wheels of a vehicle on the same
# edge, so that it turned about a point beside its middle.
_GAP_M, _GAP_PART = 1e-4, 0.01
# The part of a wheel's width that touches the floor, and the cosine that an axis along a cylinder has at least.
_TREAD_PART, _ALONG = 0.05, 0.9999
# A body that is slower than this for 2 s falls asleep: the square of its speed [m/s] plus that of its turn rate
# [rad/s], here of 1 mm/s. Bullet's own 0.05 stops what moves at 0.2 m/s, as on a conveyor belt.
_ASLEEP_M2_PER_S2 = 1e-6
# Links of a multibody besides its root: PyBullet leaves further ones out without a word.
_MAX_LINKS = 127
# Mass of a link that only has a patch's shapes.
_PATCH_KG = 1e-9
# Stiffer contacts than this are left rigid; 1 kg then sinks in by 0.1 um.
_RIGID_N_PER_M = 1e8
# An overlap of up to this is corrected no faster than the surfaces' max_vel [m]; below the lowest speed [m/s] nothing
# would come apart, and from the highest one on rigid contacts are within it.
_DEEP_M, _SLOWEST_M_PER_S, _QUICK_M_PER_S = 0.005, 1e-3, 0.5


class Blueprint(NamedTuple):
    """The data that a model is built from, and rebuilt from.

    ``merged``: the urdf_model.MergedRobot of ``robot``; ``static`` fixes its root in the world; ``mesh_cuts``: as for
    ``World.spawn``; ``self_collision``: whether any two of its links can collide with each other; ``in_limbs``: whether
    its limbs may be multibodies of their own.
    """

    name: str
    robot: Robot
    merged: MergedRobot
    static: bool
    mesh_cuts: dict | None
    self_collision: bool
    in_limbs: bool = True


def build(client: int, blueprint: Blueprint, pose: Pose, shapes: ShapeStore,
          warn: Callable[[str], None]) -> tuple[Multibodies, list[np.ndarray]]:
    """Create the multibodies of a :class:`Blueprint` with its root bodies at ``pose``, its shapes from a ShapeStore.

    Returns (Multibodies, [inertial offset (4, 4) of each root]). ``warn(text)`` is called for missing masses.
    """
    merged, bodies, offsets = blueprint.merged, [], []
    found, start = limbs(merged, blueprint.static and blueprint.in_limbs), Pose.from_matrix(pose.matrix())
    for root in merged.roots:
        own = [limb for limb in found if limb.root == root]
        made, offset = _build_tree(client, blueprint, own, start, shapes, warn)
        bodies += made
        offsets.append(offset)
    return Multibodies(client, bodies, merged, found), offsets


def _build_tree(client: int, blueprint: Blueprint, own: list[Multibody], start: Pose, shapes: ShapeStore,
                warn: Callable[[str], None]) -> tuple[list[int], np.ndarray]:
    """Create the multibodies of the Limbs ``own``, which have one root, at Pose ``start``.

    Returns PyBullet's numbers of them and the root's inertial offset (4, 4).
    """
    merged, root = blueprint.merged, blueprint.merged.links[own[0].root]
    static = blueprint.static and root.name == merged.root
    if static:
        # A root that cannot move needs no inertia, and Model.inverse_dynamics wants its axes to be the link's own.
        root_mass, root_moments, root_offset = 0.0, np.zeros(3), np.eye(4)
    else:
        root_mass, root_moments, root_offset = _inertial(root, warn)
    base = {
        "baseMass": root_mass,
        "basePosition": start.position,
        "baseOrientation": start.quaternion,
        "baseInertialFramePosition": root_offset[:3, 3].tolist(),
        "baseInertialFrameOrientation": quaternion_from_matrix(root_offset).tolist(),
        # Bullet numbers links depth first by itself, which patches are not in. Self-collision must be enabled at
        # creation; Model then keeps only the requested pairs.
        "flags": pybullet.URDF_MAINTAIN_LINK_ORDER
        | (pybullet.URDF_USE_SELF_COLLISION if blueprint.self_collision else 0)
        # Models with joints never sleep, as in Gazebo: a drive would not wake them.
        | (0 if static or own[0].joints else pybullet.URDF_ENABLE_SLEEPING),
    }
    # The first has the root's shape.
    root_shape = shapes.compound(link_collisions(merged, root.name, static), static, blueprint.mesh_cuts)
    root_shapes = [root_shape] + [NO_SHAPE] * (len(own) - 1)
    bodies = [_build_limb(client, blueprint, limb, {**base, "baseCollisionShapeIndex": shape},
                          patches(merged, limb, limb is own[0]), shapes, warn)
              for limb, shape in zip(own, root_shapes, strict=True)]
    if not static:
        pybullet.changeDynamics(bodies[0], -1, localInertiaDiagonal=root_moments.tolist(),
                                sleepThreshold=_ASLEEP_M2_PER_S2, physicsClientId=client)
    pybullet.changeDynamics(bodies[0], -1, **_contact(root.surface, 1.0, root_offset[:3, :3]), physicsClientId=client)
    set_collision_filter(client, LinkPlace(bodies[0], -1), root.surface)
    return bodies, root_offset


def _build_limb(client: int, blueprint: Blueprint, limb: Multibody, base: dict[str, Any],
                further: list[tuple[str, SurfacePatch]], shapes: ShapeStore, warn: Callable[[str], None]) -> int:
    """Create the multibody of a Multibody; ``base``: createMultiBody's arguments for the root, ``further``: its
    patches.

    Returns PyBullet's number of it.
    """
    merged, joints = blueprint.merged, list(blueprint.merged.joints.values())
    columns = {key: [] for key in _COLUMNS}
    moments, turns, order = [], [], {limb.root: 0}
    for local, number in enumerate(limb.joints):
        joint = joints[number]
        order[joint.child] = local + 1
        link = merged.links[joint.child]
        mass, principal, offset = _inertial(link, warn)
        moments.append(principal)
        turns.append(offset[:3, :3])
        columns["linkMasses"].append(mass)
        columns["linkCollisionShapeIndices"].append(
            shapes.compound(link_collisions(merged, joint.child, static=False), False, blueprint.mesh_cuts,
                            exact=is_wheel(joint)))
        columns["linkVisualShapeIndices"].append(NO_SHAPE)
        columns["linkPositions"].append(joint.origin[:3, 3].tolist())
        columns["linkOrientations"].append(quaternion_from_matrix(joint.origin).tolist())
        columns["linkInertialFramePositions"].append(offset[:3, 3].tolist())
        columns["linkInertialFrameOrientations"].append(quaternion_from_matrix(offset).tolist())
        columns["linkParentIndices"].append(joint.parent)
        columns["linkJointTypes"].append(_JOINT_TYPES[joint.type])
        columns["linkJointAxis"].append(joint.axis.tolist())
    columns["linkParentIndices"] = [order[parent] for parent in columns["linkParentIndices"]]
    by_child = {joint.child: joint for joint in joints}
    axes_of = [_add_patch(columns, order[name], patch, shapes, blueprint, name) for name, patch in further]

    body = pybullet.createMultiBody(**base, **columns, physicsClientId=client)
    # PyBullet has air drag by default; a URDF has none. The inertia goes in a separate call: given
    # together with a drag, PyBullet 3.2.7 ignores it.
    calm = {"linearDamping": 0.0, "angularDamping": 0.0, "physicsClientId": client}
    pybullet.changeDynamics(body, -1, **calm)
    for local, number in enumerate(limb.joints):
        joint = joints[number]
        pybullet.changeDynamics(body, local, **calm)
        pybullet.changeDynamics(body, local, localInertiaDiagonal=moments[local].tolist(), physicsClientId=client)
        if joint.limit.lower is not None:
            pybullet.changeDynamics(
                body,
                local,
                jointLowerLimit=joint.limit.lower,
                jointUpperLimit=joint.limit.upper,
                physicsClientId=client,
            )
        surface = merged.links[joint.child].surface
        pybullet.changeDynamics(body, local, **_contact(surface, most_friction(joint), turns[local]),
                                physicsClientId=client)
        set_collision_filter(client, LinkPlace(body, local), surface)
    for local, ((name, patch), axes) in enumerate(zip(further, axes_of, strict=True), len(limb.joints)):
        pybullet.changeDynamics(body, local, **calm)
        pybullet.changeDynamics(body, local, **_contact(patch.surface, most_friction(by_child.get(name)), axes),
                                physicsClientId=client)
        set_collision_filter(client, LinkPlace(body, local), patch.surface)
    return body


def _add_patch(columns: dict[str, list], parent: int, patch: SurfacePatch, shapes: ShapeStore, blueprint: Blueprint,
               name: str) -> np.ndarray:
    """Add a SurfacePatch of body ``name`` to createMultiBody's ``columns``. Returns the axes (3, 3) of its inertial
    frame, which are those of its friction."""
    merged = blueprint.merged
    static = blueprint.static and name == merged.root
    axes = np.eye(3)
    if patch.surface.direction is not None:
        axes = turned(np.ones(3), axes, patch.surface.direction)[1]
    shape = shapes.compound(link_collisions(merged, name, static, patch.collisions), static, blueprint.mesh_cuts,
                            exact=any(joint.child == name and is_wheel(joint) for joint in merged.joints.values()))
    row = (_PATCH_KG, shape, NO_SHAPE, [0.0] * 3, [0.0, 0.0, 0.0, 1.0], [0.0] * 3,
           quaternion_from_matrix(rigid(axes, (0.0, 0.0, 0.0))).tolist(), parent, pybullet.JOINT_FIXED, [0.0, 0.0, 1.0])
    for key, value in zip(_COLUMNS, row, strict=True):
        columns[key].append(value)
    return axes


def link_collisions(merged: MergedRobot, name: str, static: bool, shapes: list[Shape] | None = None) -> list[Shape]:
    """Return the collision shapes (urdf_model.Shape) of a link of ``merged`` as they are built: the places where
    wheels and casters touch the floor are determined. ``static``: whether the root is fixed; ``shapes``: those of one
    of its patches, by default all others.
    """
    shapes = merged.links[name].own_collisions() if shapes is None else shapes
    if name in merged.roots:
        wheels = [joint for joint in merged.joints.values() if joint.parent == name and is_wheel(joint)]
        return shapes if static or len(wheels) < 2 else [_as_caster(shape) for shape in shapes]
    axes = [joint.axis for joint in merged.joints.values() if joint.child == name and is_wheel(joint)]
    return [part for shape in shapes for part in (_as_wheel(shape, axes[0]) if axes else [shape])]


def _as_caster(shape: Shape) -> Shape:
    if not isinstance(shape.geometry, Sphere):
        return shape
    radius = shape.geometry.radius
    return replace(shape, geometry=Sphere(radius - min(_GAP_M, _GAP_PART * radius)))


def _as_wheel(shape: Shape, axis: np.ndarray) -> list[Shape]:
    """A cylinder around ``axis`` (3,) as two: one of its radius, but narrow, and one of its width."""
    if not isinstance(shape.geometry, Cylinder) or abs(shape.origin[:3, 2] @ axis) < _ALONG * np.linalg.norm(axis):
        return [shape]
    radius, length = shape.geometry.radius, shape.geometry.length
    narrow = Cylinder(radius, _TREAD_PART * length)
    return [replace(shape, geometry=narrow),
            replace(shape, geometry=Cylinder(radius - min(_GAP_M, _GAP_PART * radius), length))]


def is_wheel(joint: Joint) -> bool:
    """Whether the link behind a joint can be a wheel: its radius decides how far it goes, its friction how it pulls."""
    return joint.type == "continuous"


def set_collision_filter(client: int, place: LinkPlace, surface: Surface | None, renew: bool = False) -> None:
    """Let the link at a LinkPlace collide with those that share a bit with it (``Surface.bitmask``); ``renew``: also
    where it collides with all, so that Bullet drops the link's contacts."""
    if surface is not None and surface.bitmask is not None:
        # PyBullet's own groups are 1, and 2 for bodies without mass.
        group = surface.bitmask << 2
        pybullet.setCollisionFilterGroupMask(*place, group, group | 3 if group else 0, physicsClientId=client)
    elif renew:
        pybullet.setCollisionFilterGroupMask(*place, 1, -1, physicsClientId=client)


def most_friction(joint: Joint | None) -> float:
    """The largest coefficient of friction of the link behind a joint; None: of a root."""
    return _WHEEL_FRICTION if joint is not None and is_wheel(joint) else 1.0


def directed_bodies(merged: MergedRobot, own: bool = False) -> frozenset[str]:
    """The bodies of a urdf_model.MergedRobot whose friction depends on the direction; ``own``: on one of theirs."""
    by_child = {joint.child: joint for joint in merged.joints.values()}
    ways = {link.name: [directed(surface, most_friction(by_child.get(link.name)))
                        for surface in (link.surface, *(patch.surface for patch in link.patches))]
            for link in merged.links.values()}
    return frozenset(name for name, found in ways.items()
                     if any(way is not None and not (own and way.direction is None) for way in found))


def _contact(surface: Surface | None, most: float, axes: np.ndarray) -> dict[str, Any]:
    """Return changeDynamics' arguments for a urdf_model.Surface, or for a link without one; ``axes`` (3, 3) of the
    inertial frame in the body's."""
    surface, ways = surface or Surface(), directed(surface, most)
    # Bullet multiplies the two friction coefficients of a contact; Gazebo (ODE) takes the smaller one, and 1 by
    # default. With coefficients clamped to 1, the product equals the smaller one whenever one of them is 1. Wheels may
    # have more, as they need it on Gazebo's floors of 100.
    mu = _DEFAULT_FRICTION if surface.friction is None else min(surface.friction, most)
    arguments: dict[str, Any] = {"lateralFriction": mu}
    if ways is not None:
        arguments["lateralFriction"], arguments["anisotropicFriction"] = scales(ways, axes)
    return {**arguments, **_pressing(surface)}


def _pressing(surface: Surface) -> dict[str, float]:
    """Return changeDynamics' arguments for a urdf_model.Surface but for its friction."""
    arguments = {}
    if surface.restitution is not None:
        arguments["restitution"] = min(surface.restitution, 1.0)  # beyond 1 it would gain energy at each bounce
    stiffness, damping = stiffness_of(surface), _DEFAULT_DAMPING if surface.damping is None else surface.damping
    speed, is_rigid = surface.leaving_speed, stiffness == math.inf
    if speed is not None and (is_rigid and speed < _QUICK_M_PER_S or not is_rigid):
        # Bullet turns an overlap d into the speed d k / (dt k + c) at most, for a stiffness k and a damping c.
        stiffness = min(stiffness, _RIGID_N_PER_M)
        damping = max(damping, stiffness * _DEEP_M / max(speed, _SLOWEST_M_PER_S))
        arguments.update(contactStiffness=stiffness, contactDamping=damping)
    elif not is_rigid:
        arguments.update(contactStiffness=stiffness, contactDamping=damping)
    return arguments


def join_patches(merged: MergedRobot) -> list[str]:
    """Give the shapes of the patches of a urdf_model.MergedRobot whose surfaces are the same in Bullet to the body's
    surface, or to one patch: each patch is a link more, which costs about a microsecond in a step.

    Returns the bodies of which further shapes have the body's surface, since Bullet has no room for more links.
    """
    by_child = {joint.child: joint for joint in merged.joints.values()}
    for link in merged.links.values():
        most = most_friction(by_child.get(link.name))
        left = {}
        for patch in link.patches:
            built = _as_built(patch.surface, most)
            if built == _as_built(link.surface, most):
                continue
            if built in left:
                left[built].collisions.extend(patch.collisions)
            else:
                left[built] = SurfacePatch(patch.surface, list(patch.collisions))
        link.patches[:] = left.values()
    root_of, room = {root: root for root in merged.roots}, dict.fromkeys(merged.roots, _MAX_LINKS)
    for joint in merged.joints.values():  # parents first
        root_of[joint.child] = root_of[joint.parent]
        room[root_of[joint.child]] -= 1
    crowded = []
    for link in merged.links.values():
        root = root_of[link.name]
        if len(link.patches) > room[root]:
            crowded.append(link.name)
            del link.patches[max(room[root], 0):]
        room[root] -= len(link.patches)
    return crowded


def _as_built(surface: Surface | None, most: float) -> tuple:
    """All that Bullet is told of a surface; ``most``: as for :func:`_contact`."""
    surface = surface or Surface()
    arguments, ways = {"restitution": 0.0, **_pressing(surface)}, directed(surface, most)
    if ways is None:
        arguments["lateralFriction"] = _contact(surface, most, np.eye(3))["lateralFriction"]
    return tuple(sorted(arguments.items())), ways, ALL_BITS if surface.bitmask is None else surface.bitmask


def stiffness_of(surface: Surface) -> float:
    """The stiffness of the contacts of a urdf_model.Surface [N/m]; infinite where they are rigid."""
    given = surface.stiffness
    return math.inf if given is None or given >= _RIGID_N_PER_M else given


_COLUMNS = (
    "linkMasses",
    "linkCollisionShapeIndices",
    "linkVisualShapeIndices",
    "linkPositions",
    "linkOrientations",
    "linkInertialFramePositions",
    "linkInertialFrameOrientations",
    "linkParentIndices",
    "linkJointTypes",
    "linkJointAxis",
)


def inertial_frame(link: MergedLink) -> np.ndarray:
    """Return the inertial frame (4, 4) of a link that moves, in its body's frame."""
    return _inertial(link, lambda text: None)[2]


def _inertial(link: MergedLink, warn: Callable[[str], None]) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass, principal moments (3,) and the inertial frame (4, 4) of a link that moves."""
    given = link.inertial.mass
    mass, moments, axes = moving_inertial(link.inertial)
    ways = directed(link.surface, _WHEEL_FRICTION)
    if ways is not None and ways.direction is not None:
        moments, axes, off = turned(moments, axes, ways.direction)
        if is_off(off):
            warn("the friction of link '%s' has the directions of its principal axes of inertia, %.0f degrees from its "
                 "fdir1" % (link.name, np.degrees(off)))
    if given < bounds.MIN_MASS_KG:
        warn("link '%s' moves and has %s mass, so it gets %g kg; give it a positive <mass> in its <inertial>"
             % (link.name, "hardly any" if given > 0.0 else "no", mass))
    return mass, moments, rigid(axes, link.inertial.centre)
