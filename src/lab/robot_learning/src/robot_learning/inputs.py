# SPDX-License-Identifier: BSD-3-Clause
"""From named numbers of an observation to what a network takes in.

Joints' speeds are left out: what a policy would read from them is what it did itself. With actions of hands, joints'
angles are left out as well. Differences of places are added, in two scales: whole, and for the last centimetres. And
each thing is there as each hand sees it: a hand that grasps a handle that lies anyhow would have to learn to turn one
frame into another.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

#: Contracts name one of them, the newest first: equal names give other inputs. The second lacks what hands see.
KINDS = ("places-and-turns/2", "places-and-turns/1")
KIND = KINDS[0]
#: Scale of differences near 0 [m].
FINE_M = 0.05
_PLACE, _TURN = ("x", "y", "z"), ("qx", "qy", "qz", "qw")
_HAND = "_hand"


@dataclass(frozen=True)
class Sight:
    """Columns of a hand's turn and place, and of the turn and the place of a thing that it sees."""

    hand_turn: list[int]
    hand_place: list[int]
    turn: list[int]
    place: list[int]


class Inputs:
    """names: of the observation's numbers, such as block.x, left_hand.qw, left_s0.pos; with_joints: whether joints'
    angles count; kind: one of KINDS. len() is the number of inputs. Attributes: columns of `places` and `turns` by
    groups, and of `others`; `pairs` of places; `sights` of hands. Raises ValueError for names that appear more than
    once."""

    def __init__(self, names: Sequence[str], with_joints: bool, kind: str = KIND):
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
        place_of = {names[group[0]].rpartition(".")[0]: group for group in self.places}
        turn_of = {names[group[0]].rpartition(".")[0]: group for group in self.turns}
        posed = [thing for thing in turn_of if thing in place_of]
        self.sights = [] if kind == KINDS[1] else [
            Sight(turn_of[hand], place_of[hand], turn_of[thing], place_of[thing])
            for hand in posed if hand.endswith(_HAND) for thing in posed if thing != hand]

    def __len__(self) -> int:
        return (3 * len(self.places) + 6 * len(self.turns) + len(self.others) + 6 * len(self.pairs)
                + 12 * len(self.sights))

    def of(self, observations: np.ndarray) -> np.ndarray:
        """(frames, inputs) float32 from (frames, names)."""
        observations = np.asarray(observations, dtype=np.float64)
        places = [observations[:, group] for group in self.places]
        apart = [places[second] - places[first] for first, second in self.pairs]
        parts = [*places, *(_axes(observations[:, group])[:, :6] for group in self.turns), observations[:, self.others],
                 *apart, *(np.tanh(difference / FINE_M) for difference in apart)]
        for sight in self.sights:
            hand, thing = _axes(observations[:, sight.hand_turn]), _axes(observations[:, sight.turn])
            away = _seen(hand, observations[:, sight.place] - observations[:, sight.hand_place])
            parts += [_seen(hand, thing[:, :3]), _seen(hand, thing[:, 3:6]), away, np.tanh(away / FINE_M)]
        return np.concatenate(parts, axis=1).astype(np.float32)


def _axes(quaternions):
    """(frames, 9) the axes of the rotations, one after the other: a quaternion and its negative are the same turn."""
    x, y, z, w = quaternions.T
    return np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w),
                     2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w),
                     2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)], axis=1)


def _seen(axes, vectors):
    """(frames, 3) vectors along a frame's axes (frames, 9)."""
    return (axes.reshape(-1, 3, 3) * vectors[:, None, :]).sum(axis=2)
