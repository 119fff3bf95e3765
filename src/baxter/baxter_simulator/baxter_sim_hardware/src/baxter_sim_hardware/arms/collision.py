# SPDX-License-Identifier: BSD-3-Clause
"""Collisions of an arm: detection, the states to report, and what clients suppress at present.

Avoidance concerns the robot itself: an arm that touches the body, the other arm or its own shoulder yields. Then its
drives push with a fraction of their effort, in the modes in which the physical robot keeps its arms apart (position and
velocity). Detection concerns everything: an arm is in a collision when the torques on its joints exceed those of its
own weight and motion, or the load on its hand exceeds its limit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from baxter_model import JOINTS, is_part_of_arm
from baxter_model.self_collision import BODY

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np

SUPPRESSION_S = 0.6  # [simulated s] validity of one suppress message, as on the physical robot
AVOIDANCE, BODY_AVOIDANCE = "suppress_collision_avoidance", "suppress_body_avoidance"
CONTACT, OVERWRENCH = "suppress_contact_safety", "suppress_hand_overwrench_safety"
CUFF, GRAVITY = "suppress_cuff_interaction", "suppress_gravity_compensation"
SUPPRESSIONS = {
    AVOIDANCE: "an arm that touches the robot itself does not yield, and nothing is listed",
    BODY_AVOIDANCE: "the same for the body alone; the other arm still counts",
    CONTACT: "a load on joints does not count as a collision",
    OVERWRENCH: "a load on the hand above 100 N or 30 Nm does not count as a collision",
    CUFF: "a squeezed cuff does not make the arm float",
    GRAVITY: "torque mode without the torque that balances gravity: the arm falls",
}
# Torque [Nm] by joint from which an arm counts as squeezed, and largest load on a hand [N, Nm]: the physical robot's
# parameters. It has no value for w2; we use that of the other wrist joints.
SQUISH_NM = dict(zip(JOINTS, (16.0, 24.0, 16.0, 16.0, 7.0, 7.0, 7.0), strict=True))
HAND_FORCE_N, HAND_TORQUE_NM = 100.0, 30.0
# An arm is held by avoidance when it may keep less than this share of its speed for so long [simulated s].
HELD_SHARE, HELD_S = 0.05, 0.5


class Held:
    """Notices that avoidance keeps an arm from going on."""

    def __init__(self) -> None:
        self._since = None

    def look(self, time_s: float, share: float) -> bool:
        """Whether the arm is held at time_s [s]; share: of its speed that it may keep, 0 to 1."""
        if share >= HELD_SHARE:
            self._since = None
        elif self._since is None or time_s < self._since:
            self._since = time_s
        return self._since is not None and time_s - self._since >= HELD_S


class Suppressions:
    """Suppressions by the clients of one arm; each message is valid for SUPPRESSION_S."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._until = {}

    def take(self, kind: str, time_s: float) -> None:
        """A message of SUPPRESSIONS' `kind` came at time_s [s]."""
        self._until[kind] = time_s + SUPPRESSION_S

    def active(self, kind: str, time_s: float) -> bool:
        return time_s < self._until.get(kind, 0.0)


def touched(contacts: Iterable[tuple[str, str]], side: str) -> tuple[list[str], bool]:
    """(links that one arm touches, whether the other arm is among them), from contacts within the robot.

    contacts: iterable of (link, other link), each one that overlaps or presses.
    """
    links = set()
    for pair in contacts:
        own = [is_part_of_arm(link, side) for link in pair]
        if own == [True, True]:
            links.update(pair)
        elif any(own):
            links.add(pair[own.index(False)])
    return sorted(links), any(link != BODY and not is_part_of_arm(link, side) for link in links)


def is_squeezed(torques: np.ndarray) -> bool:
    """Whether (7,) torques from outside [Nm], torso to wrist, are more than occur in free motion."""
    return any(abs(torque) > bound for torque, bound in zip(torques, SQUISH_NM.values(), strict=True))


def is_overloaded(wrench: np.ndarray) -> bool:
    """Whether (6,) force [N] and torque [Nm] at the tip exceed the limits of a hand."""
    return bool(sum(wrench[:3] ** 2) > HAND_FORCE_N ** 2 or sum(wrench[3:] ** 2) > HAND_TORQUE_NM ** 2)
