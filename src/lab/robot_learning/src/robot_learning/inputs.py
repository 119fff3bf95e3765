# SPDX-License-Identifier: BSD-3-Clause
"""From named numbers of an observation to what a network takes in.

Joints' speeds are left out: what a policy would read from them is what it did itself. With actions of hands, joints'
angles are left out as well. Differences of places are added, in two scales: whole, and for the last centimetres.
"""
from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

#: Contracts name it; it changes when equal names would give other inputs.
KIND = "places-and-turns/1"
#: Scale of differences near 0 [m].
FINE_M = 0.05
_PLACE, _TURN = ("x", "y", "z"), ("qx", "qy", "qz", "qw")


class Inputs:
    """names: of the observation's numbers, such as block.x, left_hand.qw, left_s0.pos; with_joints: whether joints'
    angles count. len() is the number of inputs. Attributes: columns of `places` and `turns` by groups, and of `others`;
    `pairs` of places. Raises ValueError for names that appear more than once."""

    def __init__(self, names: Sequence[str], with_joints: bool):
        if len(set(names)) != len(names):
            raise ValueError("the observation has names more than once: %s" % sorted(
                {name for name in names if list(names).count(name) > 1}))
        self.names, self.with_joints = tuple(names), with_joints
        at = {name: index for index, name in enumerate(names)}
        things = dict.fromkeys(name.rpartition(".")[0] for name in names)
        # What is told as a difference follows from the places.
        absolute = [thing for thing in things if "_from_" not in thing]
        self.places = [[at["%s.%s" % (thing, axis)] for axis in _PLACE] for thing in absolute
                        if all("%s.%s" % (thing, axis) in at for axis in _PLACE)]
        self.turns = [[at["%s.%s" % (thing, part)] for part in _TURN] for thing in things
                       if all("%s.%s" % (thing, part) in at for part in _TURN)]
        taken = {index for group in (*self.places, *self.turns) for index in group}
        self.others = [index for index, name in enumerate(names) if index not in taken and "_from_" not in name
                        and not name.endswith(".vel") and (with_joints or not name.endswith(".pos"))]
        self.pairs = list(combinations(range(len(self.places)), 2))

    def __len__(self) -> int:
        return 3 * len(self.places) + 6 * len(self.turns) + len(self.others) + 6 * len(self.pairs)

    def of(self, observations: np.ndarray) -> np.ndarray:
        """(frames, inputs) float32 from (frames, names)."""
        observations = np.asarray(observations, dtype=np.float64)
        places = [observations[:, group] for group in self.places]
        apart = [places[second] - places[first] for first, second in self.pairs]
        parts = [*places, *(_two_axes(observations[:, group]) for group in self.turns), observations[:, self.others],
                 *apart, *(np.tanh(difference / FINE_M) for difference in apart)]
        return np.concatenate(parts, axis=1).astype(np.float32)


def _two_axes(quaternions):
    """(frames, 6) first and second axis of the rotations: a quaternion and its negative are the same turn."""
    x, y, z, w = quaternions.T
    return np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w),
                     2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)], axis=1)
