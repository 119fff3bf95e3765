# SPDX-License-Identifier: BSD-3-Clause
"""The elements of an SRDF as dataclasses, in the order of the document."""
from __future__ import annotations

from dataclasses import dataclass, field

VIRTUAL_JOINT_TYPES = ("fixed", "floating", "planar")


@dataclass(frozen=True)
class VirtualJoint:
    """The connection of the robot's root to the world. type: fixed, floating (any pose) or planar (x, y, turn about
    z)."""

    name: str
    type: str
    parent_frame: str
    child_link: str


@dataclass(frozen=True)
class GroupEntry:
    """A group as written: its own links, joints, chains (base link, tip link) and the names of groups in it."""

    name: str
    links: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    chains: tuple[tuple[str, str], ...] = ()
    subgroups: tuple[str, ...] = ()
    line: int = 0


@dataclass(frozen=True)
class GroupState:
    name: str
    group: str
    values: dict[str, float]  # joint to its value [rad or m]


@dataclass(frozen=True)
class EndEffector:
    """A group at the end of another. parent_link: the link it is mounted on; parent_group: "" if not given."""

    name: str
    group: str
    parent_link: str
    parent_group: str = ""


@dataclass(frozen=True)
class DisabledPair:
    """Two links that need no collision check. reason: Adjacent, Always, Default, Never, User, ..."""

    link1: str
    link2: str
    reason: str = ""


@dataclass
class Srdf:
    name: str
    virtual_joints: list[VirtualJoint] = field(default_factory=list)
    groups: dict[str, GroupEntry] = field(default_factory=dict)
    states: list[GroupState] = field(default_factory=list)
    end_effectors: list[EndEffector] = field(default_factory=list)
    passive_joints: list[str] = field(default_factory=list)
    disabled: list[DisabledPair] = field(default_factory=list)
    enabled: list[tuple[str, str]] = field(default_factory=list)
    no_default: list[str] = field(default_factory=list)  # links without collision checks against the robot by default
    joint_properties: dict[str, dict[str, str]] = field(default_factory=dict)
    # link to ((centre x y z in the link's frame, radius), ...) [m]
    spheres: dict[str, tuple[tuple[tuple[float, ...], float], ...]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
