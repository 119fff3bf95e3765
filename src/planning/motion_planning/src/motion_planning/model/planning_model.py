# SPDX-License-Identifier: BSD-3-Clause
"""A robot from URDF, SRDF and joint limits."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motion_planning.model.errors import ModelError
from motion_planning.model.group import build_groups, depth_first
from motion_planning.model.kernels import fill_frames
from motion_planning.model.limits import limit_arrays, narrow_limits
from motion_planning.model.state import State
from motion_planning.shapes import read_only
from motion_planning.srdf import parse_srdf
from urdf_model import UrdfError, parse_urdf

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.model import Group
    from motion_planning.scene import AttachedBody
    from motion_planning.srdf import Srdf
    from urdf_model import Joint, Robot

_KINDS = {"revolute": 1, "continuous": 1, "prismatic": 2}


class PlanningModel:
    """The model of the robot for planning. It is immutable, so threads can share it.

    name: the URDF's. robot: urdf_model.Robot, its limits narrowed. srdf: srdf.Srdf. warnings: on ignored entries.
    root: root link. frame: the planning frame: the parent frame of a virtual joint that moves, or else the root.
    virtual_joint: srdf.VirtualJoint or None.
    variables: names of the n movable joints (not fixed, not mimic), depth-first; index: {name: index}.
    mimics: {joint that mimics another: (variable, multiplier, offset)}: its value is multiplier * variable + offset.
    bounds (n, 2) [rad or m], -pi to pi for a continuous joint; velocity (n,), acceleration (n,) [per s,
    per s^2]; continuous (n,) bool: without limits.
    links: names, depth-first, parents first; link_index: {name: index}.
    groups: {name: Group}. end_effectors: {name: srdf.EndEffector}. passive: joints without a drive. disabled: frozenset
    of sorted pairs of links without collision check.
    """

    def __init__(self, robot: Robot, srdf: Srdf, joint_limits: Mapping[str, Any] | None = None) -> None:
        """``joint_limits``: the mapping of a joint_limits.yaml. Raises ModelError. ``robot`` is changed by it."""
        self.robot, self.srdf, self.name = robot, srdf, robot.name
        self.warnings = [*robot.warnings, *srdf.warnings]
        accelerations = narrow_limits(robot, joint_limits, self.warnings)
        joints = depth_first(robot)
        movable = [joint for joint in joints if joint.movable and joint.mimic is None]
        self.variables = tuple(joint.name for joint in movable)
        self.index = {name: number for number, name in enumerate(self.variables)}
        arrays = limit_arrays(movable, accelerations)
        self.bounds, self.velocity, self.acceleration = (read_only(array) for array in arrays[:3])
        self.continuous = read_only(arrays[3], bool)
        self.root = robot.root
        self.virtual_joint = srdf.virtual_joints[0] if srdf.virtual_joints else None
        fixed = self.virtual_joint is None or self.virtual_joint.type == "fixed"
        self.frame = self.root if self.virtual_joint is None or fixed else self.virtual_joint.parent_frame
        self.mimics = {}
        self.links = (self.root, *(joint.child for joint in joints))
        self.link_index = {name: number for number, name in enumerate(self.links)}
        self._set_kinematics(joints)
        self.groups = build_groups(robot, srdf, self, self.warnings)
        self.end_effectors = {effector.name: effector for effector in srdf.end_effectors}
        self.passive = frozenset(srdf.passive_joints)
        self.disabled = frozenset(pair_of(pair.link1, pair.link2) for pair in srdf.disabled)
        self._enabled = frozenset(pair_of(*pair) for pair in srdf.enabled)
        self._no_default = frozenset(srdf.no_default)

    @classmethod
    def from_xml(cls, urdf_xml: str | bytes, srdf_xml: str | bytes | None,
                 joint_limits: Mapping[str, Any] | None = None) -> PlanningModel:
        """Return the model of two texts (str or bytes) and the mapping of a joint_limits.yaml.

        ``srdf_xml`` may be empty: no groups then. Raises ModelError for texts that are not URDF or SRDF.
        """
        try:
            robot = parse_urdf(urdf_xml)
        except UrdfError as error:
            raise ModelError(str(error)) from None
        if srdf_xml is None or not srdf_xml.strip():
            srdf_xml = "<robot name='%s'/>" % robot.name
        try:
            srdf = parse_srdf(srdf_xml, robot)
        except ValueError as error:
            raise ModelError(str(error)) from None
        return cls(robot, srdf, joint_limits)

    def _set_kinematics(self, joints: Sequence[Joint]) -> None:
        count = len(self.links)
        parents, variables = np.full(count, -1), np.full(count, -1)
        origins, axes, kinds = np.tile(np.eye(4), (count, 1, 1)), np.zeros((count, 3)), np.zeros(count, dtype=np.int64)
        factors = np.tile((1.0, 0.0), (count, 1))
        for number, joint in enumerate(joints, 1):
            parents[number] = self.link_index[joint.parent]
            origins[number], axes[number] = joint.origin, joint.axis
            kinds[number] = _KINDS.get(joint.type, 0)
            source, factors[number] = self._driver(joint)
            variables[number] = self.index.get(source, -1)
            if joint.mimic is not None and joint.movable and source in self.index:
                self.mimics[joint.name] = (source, *map(float, factors[number]))
        self.kinematics = tuple(read_only(array, array.dtype) for array in (
            parents, origins, axes, kinds, variables, factors))

    def _driver(self, joint: Joint) -> tuple[str, tuple[float, float]]:
        """Return (name of the driving joint, (multiplier, offset)) of ``joint``, through a chain of mimic joints."""
        multiplier, offset, seen = 1.0, 0.0, {joint.name}
        while joint.mimic is not None:
            offset += multiplier * joint.mimic.offset
            multiplier *= joint.mimic.multiplier
            joint = self.robot.joints[joint.mimic.joint]
            if joint.name in seen:
                raise ModelError("joint '%s' mimics itself through %s" % (joint.name, ", ".join(sorted(seen))))
            seen.add(joint.name)
        return joint.name, (multiplier, offset)

    # -- poses --------------------------------------------------------------------------------------------------

    def frames(self, q: ArrayLike, base: ArrayLike | None = None) -> np.ndarray:
        """Return the poses (l, 4, 4) of all ``links`` in the planning frame at ``q`` (n,).

        ``base`` (4, 4): the root in the planning frame, None: identity. Mimic joints follow. Raises ModelError
        for a wrong count.
        """
        frames = np.empty((len(self.links), 4, 4))
        base = np.eye(4) if base is None else np.array(base, dtype=np.float64)
        fill_frames(self.kinematics, self.checked(q), base, frames)
        return frames

    def frame_of(self, q: ArrayLike, link: str, base: ArrayLike | None = None) -> np.ndarray:
        """Return the pose (4, 4) of ``link`` in the planning frame. Raises ModelError for an unknown link."""
        if link not in self.link_index:
            raise ModelError("robot '%s' has no link '%s'" % (self.name, link))
        return self.frames(q, base)[self.link_index[link]]

    def checked(self, q: ArrayLike) -> np.ndarray:
        """Return ``q`` as an array (n,) of floats. Raises ModelError for a wrong count."""
        values = np.array(q, dtype=np.float64)  # one memory layout, writable: numba compiles for each layout
        if values.shape != (len(self.variables),):
            raise ModelError("expected %d joint values (%s), got an array of shape %s"
                             % (len(self.variables), ", ".join(self.variables), values.shape))
        return values

    # -- states -------------------------------------------------------------------------------------------------

    def joint_values(self, q: ArrayLike) -> dict[str, float]:
        """Return {joint: value} at ``q`` (n,): the variables in order, then the joints that mimic them."""
        values = dict(zip(self.variables, self.checked(q).tolist(), strict=True))
        values.update({name: multiplier * values[source] + offset
                       for name, (source, multiplier, offset) in self.mimics.items()})
        return values

    def state(self, values: dict[str, float] | ArrayLike | None = None, base: np.ndarray | None = None,
              attached: Mapping[str, AttachedBody] | None = None) -> State:
        """Return a State: ``values`` {joint: value} or (n,), over :meth:`default_state`'s; ``base`` (4, 4)."""
        q = self._defaults() if values is None or isinstance(values, dict) else self.checked(values)
        state = State(q, np.eye(4) if base is None else base, attached or {}, self.variables)
        return state.with_joints(values) if isinstance(values, dict) else state

    def default_state(self) -> State:
        """Return the State with every joint at 0, or in the middle of its limits if 0 is beyond them."""
        return self.state()

    def _defaults(self) -> np.ndarray:
        low, high = self.bounds[:, 0], self.bounds[:, 1]
        return np.where((low <= 0.0) & (high >= 0.0), 0.0, 0.5 * (low + high))

    def group(self, name: str) -> Group:
        """Return the Group ``name``. Raises ModelError with the existing names."""
        if name not in self.groups:
            raise ModelError("robot '%s' has no group '%s'; its groups are %s"
                             % (self.name, name, ", ".join(self.groups) or "none"))
        return self.groups[name]

    def wrapped(self, q: ArrayLike) -> np.ndarray:
        """Return ``q`` (n,) with continuous joints wrapped to -pi to pi."""
        q = self.checked(q).copy()
        turns = self.continuous
        q[turns] = np.remainder(q[turns] + math.pi, 2.0 * math.pi) - math.pi
        return q

    def beyond_limits(self, q: ArrayLike, margin: float = 0.0,
                      indices: Iterable[int] | None = None) -> list[tuple[str, float, float, float]]:
        """Return [(joint, value, lower, upper)] of the values of ``q`` (n,) that exceed their limits by more than
        ``margin``.

        ``indices``: only these variables count.
        """
        q = self.checked(q)
        out = ((q < self.bounds[:, 0] - margin) | (q > self.bounds[:, 1] + margin) | ~np.isfinite(q)) & ~self.continuous
        out |= ~np.isfinite(q)
        where = np.flatnonzero(out) if indices is None else [index for index in indices if out[index]]
        return [(self.variables[k], float(q[k]), float(self.bounds[k, 0]), float(self.bounds[k, 1])) for k in where]

    # -- collisions ---------------------------------------------------------------------------------------------

    def default_collision(self, link_a: str, link_b: str) -> bool:
        """Whether the SRDF has a collision check between two links of the robot."""
        pair = pair_of(link_a, link_b)
        if link_a == link_b or pair in self.disabled:
            return False
        return pair in self._enabled or not (link_a in self._no_default or link_b in self._no_default)


def pair_of(a: str, b: str) -> tuple[str, str]:
    """Return two names as a sorted pair, as used in sets of pairs."""
    return (a, b) if a <= b else (b, a)
