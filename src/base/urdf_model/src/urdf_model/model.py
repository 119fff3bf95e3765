# SPDX-License-Identifier: BSD-3-Clause
"""URDF elements as plain dataclasses. Lengths in m, angles in rad, masses in kg, inertias in kg m^2."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .errors import UrdfError

MOVABLE_TYPES = ("revolute", "continuous", "prismatic")


def is_true(text: str | None) -> bool:
    """Return whether a flag of Gazebo's, of which ``text`` is the content, is set."""
    return (text or "").strip().lower() in ("true", "yes", "1")


@dataclass(frozen=True)
class Box:
    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """Along z, centred at the origin."""

    radius: float
    length: float


@dataclass(frozen=True)
class Sphere:
    radius: float


@dataclass(frozen=True)
class Mesh:
    filename: str  # as written: package://, file:// or a path
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    submesh: str = ""  # the part of that name alone; SDF only
    centred: bool = False  # whether the middle of that part is at the origin


@dataclass(frozen=True)
class Plane:
    """Flat, facing +z of its frame: in collisions the half space below it, in visuals a sheet of ``size``.

    No URDF element; floors and SDF models use it.
    """

    size: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True)
class Finish:
    """How a visual looks besides its colour."""

    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)  # light that it gives off, red, green, blue from 0 to 1
    gloss: float | None = None  # strength of highlights from 0 to 1; None: not given
    texture: str = ""  # a picture's file, as written: package://, file:// or a path
    repeats: tuple[float, float] = (1.0, 1.0)  # how often the picture lies side by side, and one below the other
    cut_out: bool = False  # whether transparent pixels of the picture are holes
    two_sided: bool = False  # whether the picture is also seen from behind


@dataclass
class Shape:
    """One visual or collision element: its geometry at ``origin`` (4x4, in the link's frame)."""

    geometry: Box | Cylinder | Sphere | Mesh | Plane
    origin: np.ndarray
    name: str = ""
    colour: tuple[float, float, float, float] | None = None  # rgba, visuals only
    link: str = ""  # the link it was written in
    finish: Finish | None = None  # visuals only
    surface: Surface | None = None  # collisions only, where it is another than the link's


@dataclass
class Inertial:
    """Mass, centre of mass (3,) and inertia (3, 3) about the centre of mass; both in the axes of the link's frame."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray


@dataclass
class Limit:
    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None


@dataclass(frozen=True)
class Mimic:
    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


#: Fields of Surface that may be infinite: a contact that never slides, and a rigid one.
MAY_BE_INFINITE = ("friction", "friction_across", "stiffness")

#: The bits of a Surface.
ALL_BITS = 0xFFFF


@dataclass(frozen=True)
class Surface:
    """Contact properties of a link. None: not given."""

    friction: float | None = None  # Coulomb's mu, may be infinite
    stiffness: float | None = None  # N/m, may be infinite
    damping: float | None = None  # N s/m
    restitution: float | None = None  # 0 to 1
    leaving_speed: float | None = None  # with which an overlap is corrected at most [m/s]
    friction_across: float | None = None  # mu across `direction`; None: it is `friction`, in all directions
    direction: tuple[float, float, float] | None = None  # unit, in the link's frame; None: ODE's, in the world's axes
    bitmask: int | None = None  # two links collide where they have a bit in common; None: ALL_BITS


def with_both_frictions(surface: Surface) -> Surface:
    """A Surface as Gazebo has it: where a file gives one of mu and mu2, the other is 1."""
    if surface.friction is None and surface.friction_across is None:
        return surface
    return replace(surface, friction=1.0 if surface.friction is None else surface.friction,
                   friction_across=1.0 if surface.friction_across is None else surface.friction_across)


@dataclass
class Link:
    name: str
    inertial: Inertial | None = None
    visuals: list[Shape] = field(default_factory=list)
    collisions: list[Shape] = field(default_factory=list)
    line: int = 0
    surface: Surface | None = None
    gravity: bool = True  # False: it has no weight
    self_collide: bool = False  # whether it collides with links of its model that do so, too
    decay: tuple[float, float] = (0.0, 0.0)  # the parts of its speed and turn rate that each step takes
    helper: bool = False  # between the axes of a joint; Gazebo has no such link


@dataclass
class Joint:
    name: str
    type: str
    parent: str
    child: str
    origin: np.ndarray  # 4x4, the joint's frame (at position 0) in the parent's
    axis: np.ndarray  # (3,), unit, in the joint's frame
    limit: Limit = field(default_factory=Limit)
    mimic: Mimic | None = None
    damping: float = 0.0  # N m s/rad or N s/m
    friction: float = 0.0  # N m or N
    line: int = 0
    # Whether the damping is to be integrated implicitly: as it is written, however light the links are.
    implicit_damping: bool = False
    # 4x4, the child's frame in the joint's. In a URDF they are one; an SDF joint may sit elsewhere in its child.
    child_offset: np.ndarray = field(default_factory=lambda: np.eye(4))
    spring_stiffness: float = 0.0  # N m/rad or N/m
    spring_reference: float = 0.0  # rad or m, the position without a spring's effort
    preserved: bool = False  # fixed, but what it holds stays a link for Gazebo

    @property
    def movable(self) -> bool:
        return self.type in MOVABLE_TYPES


@dataclass
class Loop:
    """A joint beside the tree of links, which it closes to a loop; it has no state."""

    name: str
    type: str  # revolute, continuous, prismatic, fixed or ball
    parent: str
    child: str
    in_parent: np.ndarray  # 4x4, the joint's frame in the parent's, in the posture at position 0
    in_child: np.ndarray  # 4x4, the same in the child's
    axis: np.ndarray  # (3,), unit, in the joint's frame


@dataclass(frozen=True)
class Gear:
    """Joint ``other`` moves ``ratio`` times as far as ``joint``."""

    joint: str
    other: str
    ratio: float  # rad or m per rad or m


@dataclass(frozen=True)
class TransmissionJoint:
    name: str  # empty where the description has none
    hardware_interfaces: tuple[str, ...]


@dataclass(frozen=True)
class Transmission:
    name: str
    type: str
    joints: tuple[TransmissionJoint, ...]
    reductions: tuple[float, ...]  # mechanicalReduction of each actuator; 1 where there is none or no number
    actuators: tuple[str, ...]


@dataclass
class Robot:
    """A parsed robot description. Dictionaries keep the order of the document."""

    name: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    root: str
    transmissions: list[Transmission] = field(default_factory=list)
    gazebo: list[Any] = field(default_factory=list)  # <gazebo> elements, untouched (lxml)
    warnings: list[str] = field(default_factory=list)
    # 4x4, the root link's frame in the model's, which is what a pose in the world refers to. One in a URDF, not in SDF.
    root_origin: np.ndarray = field(default_factory=lambda: np.eye(4))
    loops: list[Loop] = field(default_factory=list)
    gears: list[Gear] = field(default_factory=list)
    keeps_links: bool = False  # whether fixed links all stay links for Gazebo, as those of an SDF

    def movable_joints(self) -> list[Joint]:
        """Return the joints that move (revolute, continuous, prismatic), in document order."""
        return [joint for joint in self.joints.values() if joint.movable]

    def parent_joint(self, link: str) -> Joint | None:
        """Return the joint whose child is ``link``, or None for the root."""
        return self._by_child().get(link)

    def children(self, link: str) -> list[Joint]:
        """Return the joints whose parent is ``link``, in document order."""
        return [joint for joint in self.joints.values() if joint.parent == link]

    def chain(self, base: str, tip: str) -> list[Joint]:
        """Return the joints (fixed ones too) that lead from link ``base`` down to link ``tip``.

        Raises UrdfError when a link is unknown or ``tip`` does not hang below ``base``.
        """
        for name in (base, tip):
            if name not in self.links:
                raise UrdfError(
                    "robot '%s' has no link '%s'; its links are %s" % (self.name, name, ", ".join(sorted(self.links)))
                )
        by_child = self._by_child()
        joints, link = [], tip
        while link != base:
            joint = by_child.get(link)
            if joint is None:
                raise UrdfError("link '%s' of robot '%s' does not hang below link '%s'" % (tip, self.name, base))
            joints.append(joint)
            link = joint.parent
        return joints[::-1]

    def _by_child(self):
        return {joint.child: joint for joint in self.joints.values()}
