# SPDX-License-Identifier: BSD-3-Clause
"""Actions: numbers from -1 to 1 become commands of both arms and grippers.

Of each arm 7 numbers (joint_delta, joint_pos) or 6 (osc_pose), then 1 for its gripper: -1 opens, 1 closes. The left arm
comes first, with ``robosuite_order`` the right one.
"""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baxter_lab import Arm, Mode
from baxter_sim_hardware.arms.endpoint import joint_velocities
from command_line.options import counted
from urdf_model.transforms import axis_rotation

#: What 1 means of joint_delta [rad], and of osc_pose [m], [rad] about an axis of `base`: as robosuite's controllers.
JOINT_DELTA_RAD = 0.05
OSC_POSITION_M, OSC_ROTATION_RAD = 0.05, 0.5
_STILL = 1e-9

#: {control: numbers of one arm without its gripper}
CONTROLS = {"joint_delta": 7, "joint_pos": 7, "osc_pose": 6}


class ArmControl:
    """One arm: `arm`, by `control`, one of CONTROLS."""

    def __init__(self, arm: Arm, control: str):
        self._arm, self._control = arm, control
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
        if closes is not self._closes and abs(action[-1]) > _STILL:
            self._arm.gripper.command("grip" if closes else "release")
            self._closes = closes

    def send(self, share: float, begin: np.ndarray) -> None:
        """Send a set-point: `share` of the way from `begin` (7,) to the target."""
        self._arm.command(Mode.RAW_POSITION, begin + share * (self.target - begin))

    def _wanted(self, action):
        arm = self._arm
        if self._control == "joint_delta":
            return self.target + JOINT_DELTA_RAD * action
        if self._control == "joint_pos":
            middle, half = 0.5 * (arm.chain.lower + arm.chain.upper), 0.5 * (arm.chain.upper - arm.chain.lower)
            return middle + half * action
        return self._after_twist(OSC_POSITION_M * action[:3], OSC_ROTATION_RAD * action[3:])

    def _after_twist(self, shift, turn):
        """(7,) joints after the hand's pose has moved by `shift` [m] and turned by `turn` [rad], in two steps of damped
        least squares from the present target; away from singularities within a millimetre."""
        chain, q = self._arm.chain, self.target
        angle = float(np.linalg.norm(turn))
        goal = chain.fk(q)
        goal[:3, 3] += shift
        if angle > _STILL:
            goal[:3, :3] = axis_rotation(turn / angle, angle) @ goal[:3, :3]
        for _ in range(2):
            pose, jacobian = chain.fk_and_jacobian(q)
            q = np.clip(q + joint_velocities(jacobian, _difference(goal, pose)), chain.lower, chain.upper)
        return q


def _difference(goal, pose):
    """(6,) shift and turn, in `base`, from one pose to another [m, rad]."""
    turned = goal[:3, :3] @ pose[:3, :3].T
    axis = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    sine, cosine = 0.5 * np.linalg.norm(axis), 0.5 * (np.trace(turned) - 1.0)
    turn = axis * (np.arctan2(sine, cosine) / (2.0 * sine)) if sine > _STILL else np.zeros(3)
    return np.concatenate([goal[:3, 3] - pose[:3, 3], turn])


def action_size(control: str, arms: int = 2) -> int:
    """Numbers of an action. Raises ValueError for an unknown control."""
    if control not in CONTROLS:
        raise ValueError("control is %r; choices are %s" % (control, ", ".join(CONTROLS)))
    return arms * (CONTROLS[control] + 1)


def checked(action: Sequence[float], size: int) -> np.ndarray:
    """(size,) an action, clipped to -1 … 1. Raises ValueError for another size and for NaN."""
    action = np.asarray(action, dtype=float)
    if action.shape != (size,) or np.isnan(action).any():
        raise ValueError("an action is %s from -1 to 1; found %s" % (counted(size, "number"), action))
    return np.clip(action, -1.0, 1.0)
