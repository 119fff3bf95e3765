# SPDX-License-Identifier: BSD-3-Clause
"""Collision pairs of Baxter's links, the convex pieces of its body, and the solid part of its head.

Two kinds of pairs are left out: those that joint limits keep apart, and those whose shapes (thick cylinders, with a
wide bend between them) overlap although the robot's covers do not. The latter are links one or two joints apart along
an arm, the upper arm and the torso, and the two fingers of a hand (their boxes overlap by 5 mm when it is closed).
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .names import BASE_FRAME, SIDES, finger_prefix

if TYPE_CHECKING:
    from urdf_model.model import Link

# The torso: the link of this name is merged with all fixed links.
BODY = BASE_FRAME
# The pan joint's link, to which the screen is fixed.
HEAD = "head"
# Two balls of the description around the head: the robot's collision avoidance keeps its arms out of this field. Its
# only solid part is the head, which has no collision shape in the description.
HEAD_GUARDS = ("collision_head_link_1", "collision_head_link_2")
_SOLIDS = {HEAD: "as drawn", "screen": "as drawn", **dict.fromkeys(HEAD_GUARDS, "hollow")}
# The first joint of an arm, counted from 0, whose link comes near them: e0, the elbow's.
FIRST_AVOIDING = 2
# An arm from torso to wrist; the links of the description, of which several are one body.
SHOULDER, UPPER_ARM = "upper_shoulder", "lower_shoulder"
BEYOND_UPPER_ARM = ("upper_elbow", "lower_elbow", "upper_forearm", "lower_forearm", "wrist")
HAND = ("lower_forearm", "wrist")

# Planes through the meshes of the body [m, in the link's frame]: where its outline changes. Above -0.64 the pedestal
# is a column, below it has legs; the torso has lugs for the arms from 0.08 to 0.17, a ledge up to 0.22, its back and
# chest up to 0.48, handles up to 0.62, and a neck above. Up to the chest it is widest in front of -0.02; folded arms
# lie beside its back. Cut there, no convex piece overlaps them.
MESH_CUTS = {
    "pedestal": (("z", -0.64), *((axis, offset, -2.0, -0.64) for axis in "xy" for offset in (-0.17, 0.17))),
    "torso": (("z", 0.08), ("z", 0.17), ("z", 0.22), ("z", 0.48), ("z", 0.7),
              *(("y", offset, 0.08, 0.17) for offset in (-0.17, 0.17)),
              *(("y", offset, 0.48, 0.7) for offset in (-0.09, 0.09)), ("x", -0.02, -0.1, 0.485)),
}


def self_collision_pairs(links: dict[str, Link] | list[str]) -> list[tuple[str, str]]:
    """[(link, link)] of those that collide, for a Baxter with these link names (any container)."""
    arms = {side: _Arm(side, links) for side in SIDES}
    left, right = (arms[side] for side in SIDES)
    # The shoulders' first links only rotate, far apart.
    pairs = [(a, b) for a in left.everything for b in right.everything
             if not (a in left.shoulder and b in right.shoulder)]
    for arm in arms.values():
        pairs += [(part, link) for part in (BODY, HEAD) for link in arm.beyond_upper_arm]
        pairs += [(link, other) for link in (*arm.shoulder, *arm.upper_arm) for other in arm.hand]
    return [pair for pair in pairs if all(link in links for link in pair)]


def spawn_options(links: dict[str, Link] | list[str]) -> dict[str, Any]:
    """Spawn options of a model plugin for a Baxter with these link names (any container).

    {"self_collision_pairs", "mesh_cuts": as for `bullet_sim.World.spawn`, "solids": as for
    `bullet_sim.solids.with_solids`}.
    """
    return {"self_collision_pairs": self_collision_pairs(links), "mesh_cuts": MESH_CUTS,
            "solids": {link: solid for link, solid in _SOLIDS.items() if link in links}}


class _Arm:
    """One arm's link names, as far as this robot has them."""

    def __init__(self, side: str, links: dict[str, Link] | list[str]) -> None:
        def named(*suffixes: str) -> tuple[str, ...]:
            return tuple("%s_%s" % (side, suffix) for suffix in suffixes)

        fingers = tuple(sorted(link for link in links
                               if link.startswith(finger_prefix(side)) and link.endswith("_finger")))
        self.shoulder, self.upper_arm = named(SHOULDER), named(UPPER_ARM)
        self.beyond_upper_arm = named(*BEYOND_UPPER_ARM) + fingers
        self.hand = named(*HAND) + fingers
        self.everything = self.shoulder + self.upper_arm + self.beyond_upper_arm
