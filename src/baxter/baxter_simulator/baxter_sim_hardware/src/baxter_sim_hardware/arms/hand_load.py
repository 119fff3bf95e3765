# SPDX-License-Identifier: BSD-3-Clause
"""The weight in the hands as the arms' controllers know it, and its error.

Gravity compensation computes with a model of the robot. The vendor's grippers are in it, a client's tool is not until
EndEffectorCommand `configure` says what it weighs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from baxter_model import tip_of
from baxter_model.description import cup_of, openings_of
from baxter_sim_hardware.errors import CommandRefused
from urdf_model import merge_fixed
from urdf_model.merge import combine

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from arm_kinematics import Chain
    from urdf_model import Robot

# Bounds of what a client may say: ten times the payload of an arm, the length of an arm.
MAX_KG, FARTHEST_M = 25.0, 1.0
MIN_KG = 0.001  # the frames of a bare hand weigh less in its description


class HandLoad(NamedTuple):
    """mass [kg]; centre (3,) [m] in the frame `<side>_hand`."""

    mass: float
    centre: np.ndarray


NOTHING = HandLoad(0.0, np.zeros(3))


def read_load(urdf: Any) -> HandLoad:
    """The HandLoad that the value of `urdf` in the arguments of `configure` tells of. Raises CommandRefused.

    urdf: {"name": ..., "link": [{"name": ..., "inertial": {"mass": {"value": kg}, "origin": {"xyz": [x, y, z]}}}]}.
    """
    parts = []
    try:
        for link in urdf["link"]:
            inertial = link["inertial"]
            mass = _number(inertial["mass"]["value"], 0.0, MAX_KG)
            centre = [_number(value, -FARTHEST_M, FARTHEST_M)
                      for value in inertial.get("origin", {}).get("xyz", (0.0, 0.0, 0.0))]
            parts.append((mass, np.array(centre).reshape(3), np.zeros((3, 3))))
        if not parts:
            raise ValueError("no link")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CommandRefused(
            "configure: urdf has no weight (%s: %s); it must be {\"name\": ..., \"link\": [{\"inertial\": {\"mass\": "
            "{\"value\": 0 to %g kg}, \"origin\": {\"xyz\": [3 numbers within %g m]}}}]}" % (
                type(error).__name__, error, MAX_KG, FARTHEST_M)) from None
    whole = combine(parts)
    return HandLoad(whole.mass, whole.centre)


def _number(value: Any, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ValueError("%r" % (value,))
    return float(value)


def unknown_tool(robot: Robot, side: str) -> HandLoad:
    """The HandLoad of the links on one hand in the description that are not a gripper of the vendor's."""
    if openings_of(robot, side) or cup_of(robot, side):
        return NOTHING
    frames, hand = merge_fixed(robot).frames, "%s_hand" % side
    to_hand = np.linalg.inv(frames[hand].offset)
    parts, below = [], [hand]
    while below:
        for joint in robot.children(below.pop()):
            below.append(joint.child)
            inertial, frame = robot.links[joint.child].inertial, frames[joint.child]
            if inertial is not None and frame.link == frames[hand].link:
                place = to_hand @ frame.offset
                parts.append((inertial.mass, place[:3, :3] @ inertial.centre + place[:3, 3], np.zeros((3, 3))))
    whole = combine(parts)
    return HandLoad(whole.mass, whole.centre) if whole.mass >= MIN_KG else NOTHING


class HandLoads:
    """The error of gravity compensation for both arms.

    robot: urdf_model.Robot; chains: {side: Chain}, base to tip; index: {side: (7,) indices of its joints}; told:
    function(side) -> the `HandLoad` that a client has told of, or None.
    """

    def __init__(self, robot: Robot, chains: Mapping[str, Chain], index: Mapping[str, np.ndarray],
                 told: Callable[[str], HandLoad | None]) -> None:
        frames = merge_fixed(robot).frames
        self._chains, self._index, self._told = chains, index, told
        self._in_tip = {side: (np.linalg.inv(frames[tip_of(side)].offset) @ frames["%s_hand" % side].offset)
                        for side in chains}
        self._tools = {side: unknown_tool(robot, side) for side in chains}

    def correct(self, efforts: np.ndarray, position: np.ndarray, gravity_in_base: Callable[[], np.ndarray]) -> None:
        """Make `efforts` (n,) [Nm], which balance all that the description has, those that the controllers know of.

        position: (n,) [rad]; gravity_in_base: function -> (3,) [m/s^2].
        """
        for side, chain in self._chains.items():
            told, tool = self._told(side), self._tools[side]
            if told is None and tool is NOTHING:
                continue
            index = self._index[side]
            gravity = gravity_in_base()
            rotations, origins = chain.joint_frames(position[index])
            place = rotations[-1] @ self._in_tip[side][:3, :3], (
                rotations[-1] @ self._in_tip[side][:3, 3] + origins[-1])
            for load, sign in ((told or NOTHING, 1.0), (tool, -1.0)):
                arm = place[0] @ load.centre + place[1] - origins[:-1]
                efforts[index] -= sign * np.einsum("ji,ji->j", rotations[:-1, :, 2],
                                                   np.cross(arm, load.mass * gravity))
