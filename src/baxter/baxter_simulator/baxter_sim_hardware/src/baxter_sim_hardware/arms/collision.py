# SPDX-License-Identifier: BSD-3-Clause
"""Collisions of an arm: detection, the states to report, and what a client has suppressed for the moment.

Avoidance is about the robot itself: an arm that touches the body, the other arm or its own shoulder yields, that is its
drives push with a fraction of what they have, in the modes in which the physical robot keeps its arms apart (position
and velocity). Detection is about everything: an arm is in a collision when its joints feel more than its own weight and
motion explain, or its hand more than it may carry.
"""
from baxter_model import JOINTS, is_part_of_arm
from baxter_model.self_collision import BODY

SUPPRESSION_S = 0.6  # [simulated s] the physical robot's: how long one suppress message counts
AVOIDANCE, BODY_AVOIDANCE = "suppress_collision_avoidance", "suppress_body_avoidance"
CONTACT, OVERWRENCH = "suppress_contact_safety", "suppress_hand_overwrench_safety"
CUFF, GRAVITY = "suppress_cuff_interaction", "suppress_gravity_compensation"
SUPPRESSIONS = {
    AVOIDANCE: "an arm that touches the robot itself does not yield, and nothing is listed",
    BODY_AVOIDANCE: "the same for the body alone; the other arm still counts",
    CONTACT: "joints that feel too much are no collision",
    OVERWRENCH: "a hand that feels more than 100 N or 30 Nm is no collision",
    CUFF: "a squeezed cuff does not make the arm float",
    GRAVITY: "torque mode without the torque that balances gravity: the arm falls",
}
# Torque [Nm] by joint from which an arm counts as squeezed, and what a hand may feel [N, Nm]: the physical robot's
# parameters. It gives no figure for w2; the wrist's others stand in.
SQUISH_NM = dict(zip(JOINTS, (16.0, 24.0, 16.0, 16.0, 7.0, 7.0, 7.0), strict=True))
HAND_FORCE_N, HAND_TORQUE_NM = 100.0, 30.0


class Suppressions:
    """What one arm's clients have switched off; each message counts for SUPPRESSION_S."""

    def __init__(self):
        self.reset()

    def reset(self):
        self._until = {}

    def take(self, kind, time_s):
        """A message of SUPPRESSIONS' `kind` came at time_s [s]."""
        self._until[kind] = time_s + SUPPRESSION_S

    def active(self, kind, time_s):
        return time_s < self._until.get(kind, 0.0)


def touched(contacts, side):
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


def is_squeezed(torques):
    """Whether (7,) torques from outside [Nm], torso to wrist, are more than an arm meets in free motion."""
    return any(abs(torque) > bound for torque, bound in zip(torques, SQUISH_NM.values(), strict=True))


def is_overloaded(wrench):
    """Whether (6,) force [N] and torque [Nm] at the tip are more than a hand may feel."""
    return bool(sum(wrench[:3] ** 2) > HAND_FORCE_N ** 2 or sum(wrench[3:] ** 2) > HAND_TORQUE_NM ** 2)
