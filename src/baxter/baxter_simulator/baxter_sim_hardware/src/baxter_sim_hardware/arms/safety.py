# SPDX-License-Identifier: BSD-3-Clause
"""The effect `safety`: an arm that collides stops; it keeps away from the other arm and from the body."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from baxter_sim_hardware import effects
from baxter_sim_hardware.errors import BaxterHardwareError

from . import avoidance, collision

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from .external_load import ExternalLoad


class Felt(NamedTuple):
    """(n,) each, means over some ticks: where the joints are, the efforts exerted, and those for the robot's own weight
    and motion [rad, m; Nm, N]."""

    position: np.ndarray
    effort: np.ndarray
    own_effort: np.ndarray


class Distances:
    """How far arms keep away from each other and from the body.

    numbers: {section: {number: {name: value}}} as `effects.read` has them; links: {side: (7,) names of the links behind
    its joints}; radius: of the arms [m]. Raises BaxterHardwareError.
    """

    def __init__(self, numbers: Mapping[str, Mapping[str, Mapping[str, float]]], links: Mapping[str, Sequence[str]],
                 radius: float) -> None:
        rows = numbers["safety"]
        self._links, self._blocks = links, blocks_of(numbers["body"])
        self._closing_s, margin, body_margin = (
            effects.positive(rows, number, "arm") for number in ("closing_time", "margin", "body_margin"))
        self._apart_m, self._from_body_m = 2.0 * radius + margin, radius + body_margin

    def between(self, field: avoidance.Field, side: str, frames: Sequence[Mapping[str, tuple[np.ndarray, np.ndarray]]],
                rates: np.ndarray) -> avoidance.Field:
        """`field` of one arm with the other arm in it, too.

        frames: sequence of {side: (rotations, origins) of its joints}: where the arms are, where they are commanded to
        be; rates: (7,) [rad/s] as for `avoidance.field`.
        """
        other, = set(self._links) - {side}
        slowing, near = field.slowing, set()
        for each in frames:
            left, share = avoidance.between(each[side], each[other], rates, self._apart_m, self._closing_s)
            slowing = min(slowing, share)
            near.update(name for name, rest in zip(self._links[other], left, strict=True) if rest < avoidance.FIELD_M)
        return field._replace(slowing=slowing, other=tuple(sorted(near)))

    def around(self, field: avoidance.Field, side: str, frames: Sequence[Mapping[str, tuple[np.ndarray, np.ndarray]]],
               rates: np.ndarray) -> avoidance.Field:
        """`field` of one arm with the body in it, too; frames, rates: as for `between`."""
        slowing, near = field.slowing, set()
        for each in frames:
            left, share = avoidance.around(self._blocks, each[side], rates, self._from_body_m, self._closing_s)
            slowing = min(slowing, share)
            if left.min() < avoidance.FIELD_M:
                near.update(name for name, rest in zip(self._blocks.links, left, strict=True)
                            if rest < avoidance.FIELD_M)
        return field._replace(slowing=slowing, body=tuple(sorted(near)))


class Safety(Distances):
    """numbers, links, radius: as for `Distances`; load: `external_load.ExternalLoad`. Raises BaxterHardwareError.

    Attributes: `hold_s` [s] for which an arm stands that has collided; `collides`: {side: whether it did at the last
    look}.
    """

    def __init__(self, numbers: Mapping[str, Mapping[str, Mapping[str, float]]], load: ExternalLoad,
                 links: Mapping[str, Sequence[str]], radius: float) -> None:
        super().__init__(numbers, links, radius)
        self.load, self.hold_s = load, effects.positive(numbers["safety"], "hold", "arm")
        self.collides = dict.fromkeys(links, False)

    def forget(self) -> None:
        """The joints were put elsewhere."""
        self.load.forget()
        self.collides = dict.fromkeys(self._links, False)

    def felt(self) -> Felt | None:
        """The `Felt` since the last call, or None if no tick has passed."""
        found = self.load.mean()
        return None if found is None else Felt(self.load.position, *found)


def blocks_of(rows: Mapping[str, Mapping[str, float]]) -> avoidance.Blocks:
    """The `avoidance.Blocks` of the body. rows: {block: {name: value}} as `effects.read` has them for "body"; a block's
    name begins with that of its link. Raises BaxterHardwareError."""
    names = ("x_least", "y_least", "z_least", "x_most", "y_most", "z_most", "first_joint")
    try:
        values = np.array([[row[name] for name in names] for row in rows.values()], dtype=float)
    except KeyError as error:
        raise BaxterHardwareError("a block of the section 'body' has no %s; each needs %s" % (
            error, ", ".join(names))) from None
    corners = values[:, :6].reshape(-1, 2, 3)
    if not (corners[:, 0] < corners[:, 1]).all():
        raise BaxterHardwareError("a block of the section 'body' is not greater than nothing; its least coordinates "
                                  "must be smaller than its greatest")
    return avoidance.Blocks(tuple(name.split("_")[0] for name in rows), values[:, 6].astype(np.int64), corners)


def reason(torques: np.ndarray, wrench: np.ndarray, ignored: Callable[[str], bool]) -> str:
    """Why the loads from outside, (7,) torques [Nm] and (6,) wrench [N, Nm] at the tip, are a collision, or "".

    ignored: function(kind of suppression) -> whether it is in force.
    """
    if collision.is_squeezed(torques) and not ignored(collision.CONTACT):
        joint, bound = max(collision.SQUISH_NM.items(),
                           key=lambda each: abs(torques[list(collision.SQUISH_NM).index(each[0])]) / each[1])
        return "%s feels %.1f Nm from outside; %g are allowed" % (
            joint, abs(torques[list(collision.SQUISH_NM).index(joint)]), bound)
    if collision.is_overloaded(wrench) and not ignored(collision.OVERWRENCH):
        return "the hand feels %.0f N and %.1f Nm; %g N and %g Nm are allowed" % (
            np.linalg.norm(wrench[:3]), np.linalg.norm(wrench[3:]), collision.HAND_FORCE_N, collision.HAND_TORQUE_NM)
    return ""
