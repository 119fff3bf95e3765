# SPDX-License-Identifier: BSD-3-Clause
"""Actions: numbers from -1 to 1 become commands of both arms and grippers.

Of each arm 7 numbers (joint_delta, joint_pos) or 6 (osc_pose), then 1 for its gripper: -1 opens, 1 closes. The left arm
comes first, with ``robosuite_order`` the right one.
"""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baxter_lab import Mode
from baxter_sim_hardware.arms.endpoint import SINGULARITY_DAMPING
from baxter_sim_hardware.errors import ArmStands
from command_line.options import counted

from .stage import StageArm
from .twist import after

#: What 1 means of joint_delta [rad], and of osc_pose [m], [rad] about an axis of `base`: as robosuite's controllers.
JOINT_DELTA_RAD = 0.05
OSC_POSITION_M, OSC_ROTATION_RAD = 0.05, 0.5
OSC_SCALE = np.repeat((OSC_POSITION_M, OSC_ROTATION_RAD), 3)
_STILL = 1e-9

#: {control: numbers of one arm without its gripper}
CONTROLS = {"joint_delta": 7, "joint_pos": 7, "osc_pose": 6}


class ArmControl:
    """One arm, `arm`, by `control`, one of CONTROLS. Without a gripper the last number of its actions does nothing."""

    def __init__(self, arm: StageArm, control: str, has_gripper: bool = True) -> None:
        self._arm, self._control, self._has_gripper = arm, control, has_gripper
        self.reset()

    def reset(self) -> None:
        """The arm was put elsewhere."""
        self._closes = None
        self.target = self._arm.angles.copy()

    def take(self, action: np.ndarray) -> None:
        """Command the arm and its gripper by one action, (8,) or (7,), of numbers from -1 to 1."""
        wanted = self._wanted(action[:-1])
        self.target = np.clip(wanted, self._arm.chain.lower, self._arm.chain.upper)
        closes = action[-1] > 0.0
        if self._has_gripper and closes is not self._closes and abs(action[-1]) > _STILL:
            self._arm.gripper.command("grip" if closes else "release")
            self._closes = closes

    def send(self, share: float, begin: np.ndarray) -> None:
        """Send a set-point: `share` of the way from `begin` (7,) to the target. An arm that stands after a collision
        takes none, as on the robot; it goes on from where it is."""
        try:
            self._arm.command(Mode.RAW_POSITION, begin + share * (self.target - begin))
        except ArmStands:
            self.target = self._arm.angles.copy()

    def _wanted(self, action: np.ndarray) -> np.ndarray:
        arm = self._arm
        if self._control == "joint_delta":
            return self.target + JOINT_DELTA_RAD * action
        if self._control == "joint_pos":
            middle, half = 0.5 * (arm.chain.lower + arm.chain.upper), 0.5 * (arm.chain.upper - arm.chain.lower)
            return middle + half * action
        return after(arm.chain.arrays, arm.chain.limit_arrays, self.target, OSC_SCALE * action, SINGULARITY_DAMPING)


def action_size(control: str, arms: int = 2) -> int:
    """Numbers of an action. Raises ValueError for an unknown control."""
    if control not in CONTROLS:
        raise ValueError("control is %r; choices are %s" % (control, ", ".join(CONTROLS)))
    return arms * (CONTROLS[control] + 1)


def checked(action: Sequence[float] | np.ndarray, size: int) -> np.ndarray:
    """(size,) an action, clipped to -1 … 1. Raises ValueError for another size and for NaN."""
    action = np.asarray(action, dtype=float)
    if action.shape != (size,) or np.isnan(action).any():
        # Gymnasium's vector of processes formats the traceback, with the raising line in it, by %.
        text = "an action is %s from -1 to 1; found %s" % (counted(size, "number"), action)
        raise ValueError(text)
    return np.clip(action, -1.0, 1.0)
