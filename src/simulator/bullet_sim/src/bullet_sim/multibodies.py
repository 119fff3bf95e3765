# SPDX-License-Identifier: BSD-3-Clause
"""The multibodies that one model consists of in Bullet.

A step costs Bullet, for each joint that is driven, a pass over all joints of its multibody. A fixed root transmits
nothing, so the limbs on it need not be one multibody: two arms as two cost a quarter less.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from urdf_model import MergedRobot, SurfacePatch

# A limb with fewer joints joins another one: a multibody costs something, too.
_MIN_JOINTS = 4
# Groups of joints that are remembered. A robot drives a few of them at every tick.
_MAX_SHARES = 64


class LinkPlace(NamedTuple):
    """Where Bullet has a link and the joint before it."""

    body: int  # PyBullet's number of the multibody
    index: int  # in it; -1 is its root


class MultibodyState(NamedTuple):
    """The state of a model: PyBullet's (position, quaternion) of its base and (linear, angular) velocity of that, None
    for one that is fixed or at rest; positions and velocities of the joints (n,); {index: the same two of its loose
    roots}."""

    base: tuple
    joints: np.ndarray
    twist: tuple | None
    velocity: np.ndarray
    loose: dict


class Multibody(NamedTuple):
    """A multibody: its root, a body of a urdf_model.MergedRobot, and the numbers of its joints, ascending."""

    root: str
    joints: list


def link_indices(merged: MergedRobot) -> dict[str, int]:
    """Return {body: its index here} of a urdf_model.MergedRobot: the number of its joint, -1 for the root, and -2, -3
    and so on for those of ``loose``."""
    return {**{body: -1 - number for number, body in enumerate(merged.roots)},
            **{joint.child: number for number, joint in enumerate(merged.joints.values())}}


def limbs(merged: MergedRobot, separate: bool) -> list[Multibody]:
    """The Limbs that a urdf_model.MergedRobot is built as: those on its root first.

    One for each root, unless ``separate`` and several limbs with some joints are on the first, which must be fixed.
    """
    root_of, trees = {body: body for body in merged.roots}, {body: [] for body in merged.roots}
    for number, joint in enumerate(merged.joints.values()):
        root_of[joint.child] = root_of[joint.parent]
        trees[root_of[joint.child]].append(number)
    first = trees.pop(merged.root)
    on_root = _limbs_on_root(merged, first) if separate else [first]
    return [*(Multibody(merged.root, numbers) for numbers in on_root), *(Multibody(*tree) for tree in trees.items())]


def _limbs_on_root(merged: MergedRobot, tree: list[int]) -> list[list[int]]:
    joints = list(merged.joints.values())
    limb_of, found = {}, {}
    for number in tree:
        joint = joints[number]
        limb_of[joint.child] = limb_of.get(joint.parent, joint.child)
        found.setdefault(limb_of[joint.child], []).append(number)
    large = [limb for limb in found.values() if len(limb) >= _MIN_JOINTS]
    small = [number for limb in found.values() if len(limb) < _MIN_JOINTS for number in limb]
    if len(large) < 2:
        return [tree]
    least = min(large, key=len)
    return [sorted(limb + small) if limb is least else limb for limb in large]


def patches(merged: MergedRobot, limb: Multibody, with_root: bool) -> list[tuple[str, SurfacePatch]]:
    """[(body, its urdf_model SurfacePatch)] of a Multibody: further links of its multibody, fixed to those of the
    joints and behind them. ``with_root``: with those of the root."""
    joints = list(merged.joints.values())
    bodies = [limb.root] * with_root + [joints[number].child for number in limb.joints]
    return [(body, patch) for body in bodies for patch in merged.links[body].patches]


class Multibodies:
    """Reads and commands the joints of several multibodies as those of one."""

    def __init__(self, client: int, bodies: Iterable[int], merged: MergedRobot, found: Sequence[Multibody]) -> None:
        """``client``: PyBullet's; ``bodies``: its numbers of the multibodies, the first has the root's shape;
        ``found``: what :func:`limbs` returned for ``merged``, one for each of them."""
        self._client = client
        self.bodies = tuple(bodies)
        #: {index of :func:`link_indices`: LinkPlace}
        self.places = {-1: LinkPlace(self.bodies[0], -1)}
        joints = [limb.joints for limb in found]
        self._joints, self._local = joints, [list(range(len(numbers))) for numbers in joints]
        indices = link_indices(merged)
        self._roots = {body: indices[limb.root] for body, limb in zip(self.bodies, found, strict=True)}
        for body, numbers in zip(self.bodies, joints, strict=True):
            if self._roots[body] != -1:
                self.places[self._roots[body]] = LinkPlace(body, -1)
            self.places.update((number, LinkPlace(body, local)) for local, number in enumerate(numbers))
        in_turn = [number for numbers in joints for number in numbers]
        self._order = None
        if in_turn != sorted(in_turn):
            self._order = sorted(range(len(in_turn)), key=in_turn.__getitem__)
        self._indices: dict[tuple[int, int], int] = {place: index for index, place in self.places.items()}
        #: {index: the Places of its patches, in their order}
        self.patches = {}
        seen = set()
        for body, limb in zip(self.bodies, found, strict=True):
            for further, (name, _) in enumerate(patches(merged, limb, limb.root not in seen), len(limb.joints)):
                self.patches.setdefault(indices[name], []).append(LinkPlace(body, further))
                self._indices[body, further] = indices[name]
            seen.add(limb.root)
        self._shares = {}

    def index(self, body: int, local: int) -> int:
        """The model's index of the link that PyBullet has as ``local`` of ``body``."""
        return self._roots[body] if local == -1 else self._indices[body, local]

    def all_places(self, index: int) -> tuple[LinkPlace, ...]:
        """The LinkPlace of a link and those of its patches."""
        return (self.places[index], *self.patches.get(index, ()))

    def joint_states(self) -> Sequence[tuple]:
        """PyBullet's states of all joints, in the order of the model."""
        if len(self.bodies) == 1:
            return pybullet.getJointStates(self.bodies[0], self._local[0], physicsClientId=self._client)
        states = []
        for body, local in zip(self.bodies, self._local, strict=True):
            if local:
                states += pybullet.getJointStates(body, local, physicsClientId=self._client)
        return states if self._order is None else [states[number] for number in self._order]

    def command(self, index: np.ndarray, mode: int, **columns: list) -> None:
        """``setJointMotorControlArray`` for joints ``index`` (k,), an int array; ``columns``: PyBullet's arguments,
        lists of k."""
        for body, local, rows in self._share(index):
            pybullet.setJointMotorControlArray(
                body, local, mode, physicsClientId=self._client,
                **(columns if rows is None else {name: _rows(column, rows) for name, column in columns.items()}))

    def put(self, index: np.ndarray, position: list[float], velocity: list[float]) -> None:
        """Put joints ``index`` (k,), an int array, at ``position`` and ``velocity``, lists of k, at once."""
        positions, velocities = [[value] for value in position], [[value] for value in velocity]
        for body, local, rows in self._share(index):
            values = (positions, velocities) if rows is None else (_rows(positions, rows), _rows(velocities, rows))
            # In one call, since each call computes all link poses.
            pybullet.resetJointStatesMultiDof(body, local, *values, physicsClientId=self._client)

    def inverse_dynamics(self, position: list[float], velocity: list[float], acceleration: list[float]) -> list[float]:
        """``calculateInverseDynamics`` of lists over all joints; returns a list."""
        efforts = [0.0] * len(position)
        for body, numbers in zip(self.bodies, self._joints, strict=True):
            found = pybullet.calculateInverseDynamics(
                body, *([values[number] for number in numbers] for values in (position, velocity, acceleration)),
                physicsClientId=self._client)
            for number, effort in zip(numbers, found, strict=True):
                efforts[number] = effort
        return efforts

    def mass_matrices(self, position: list[float]) -> Iterator[tuple[list[int], Sequence[Sequence[float]]]]:
        """(numbers of the joints, ``calculateMassMatrix`` of them) of each multibody; ``position``: list over all
        joints."""
        for body, numbers in zip(self.bodies, self._joints, strict=True):
            yield numbers, pybullet.calculateMassMatrix(body, [position[number] for number in numbers],
                                                        physicsClientId=self._client)

    def root_of(self, index: int) -> int:
        """The index of the root of the tree that a link is in."""
        return self._roots[self.places[index].body]

    def set_root(self, index: int, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Put the root of that index there, with all limbs on it."""
        for body in self.bodies:
            if self._roots[body] == index:
                pybullet.resetBasePositionAndOrientation(body, position, quaternion, physicsClientId=self._client)

    def contacts(self, other: Multibodies | None = None) -> list[tuple]:
        """PyBullet's contacts of the multibodies, with those of ``other`` (Multibodies) where it is given; each
        once."""
        if other is None:
            found = []
            for number, body in enumerate(self.bodies):
                points = pybullet.getContactPoints(bodyA=body, physicsClientId=self._client) or ()
                # Those with an earlier one are there already.
                found += [point for point in points if point[2] not in self.bodies[:number]]
            return found
        pairs = [(a, b) for number, a in enumerate(self.bodies)
                 for b in (self.bodies[number:] if other is self else other.bodies)]
        return [point for a, b in pairs
                for point in pybullet.getContactPoints(bodyA=a, bodyB=b, physicsClientId=self._client) or ()]

    def remove(self) -> None:
        """Take the multibodies out of the physics."""
        for body in self.bodies:
            pybullet.removeBody(body, physicsClientId=self._client)

    def _share(self, index: np.ndarray) -> Sequence[tuple[int, list[int], slice | list[int] | None]]:
        """[(multibody, its joints, their rows among ``index``; None: all)]"""
        if len(self.bodies) == 1:
            return ((self.bodies[0], index.tolist(), None),)
        key = index.dtype, index.tobytes()
        shares = self._shares.get(key)
        if shares is None:
            if len(self._shares) >= _MAX_SHARES:
                self._shares.clear()
            shares = self._shares[key] = self._make_share(index.tolist())
        return shares

    def _make_share(self, index: list[int]) -> list[tuple[int, list[int], slice | list[int] | None]]:
        rows_of = {}
        for row, number in enumerate(index):
            rows_of.setdefault(self.places[number].body, []).append(row)
        return [(body, [self.places[index[row]].index for row in rows], _as_slice(rows, len(index)))
                for body, rows in rows_of.items()]


def _as_slice(rows: list[int], count: int) -> slice | list[int] | None:
    """Ascending ``rows`` of ``count``: None for all of them, a slice where they follow each other, which is quicker."""
    if len(rows) == count:
        return None
    return slice(rows[0], rows[-1] + 1) if rows[-1] - rows[0] + 1 == len(rows) else rows


def _rows(column: list, rows: slice | list[int]) -> list:
    return column[rows] if isinstance(rows, slice) else [column[row] for row in rows]
