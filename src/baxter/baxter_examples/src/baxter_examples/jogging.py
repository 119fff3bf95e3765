# SPDX-License-Identifier: BSD-3-Clause
"""Move single joints by small steps."""
from __future__ import annotations

from baxter_interface import Limb
from baxter_model import SIDES

STEP_RAD = 0.1


class Jogging:
    """Both arms, joint by joint."""

    def __init__(self) -> None:
        self._limbs = {side: Limb(side) for side in SIDES}
        # Steps add to the last command, not to the measured angle: the arm is still moving, and quick keys would be
        # lost.
        self._targets = {}

    def step(self, side: str, joint: str, step_rad: float) -> None:
        """Move the joint (short name, such as "s0") by `step_rad`."""
        limb, name = self._limbs[side], "%s_%s" % (side, joint)
        here = limb.joint_angle(name)
        target = self._targets.get(name, here)
        # Blocked, at its limit, or moved by others: begin where it is.
        if abs(target - here) > 2.0 * abs(step_rad):
            target = here
        self._targets[name] = target + step_rad
        limb.set_joint_positions({name: self._targets[name]})
