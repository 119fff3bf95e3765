# SPDX-License-Identifier: BSD-3-Clause
"""The command mode of each joint, its commanded value, and the time at which it expires."""

from __future__ import annotations

import numpy as np

from .joint_command import Mode

# Comparing an array with a member of an enum takes ten times as long.
POSITION, VELOCITY, TORQUE, RAW_POSITION = (
    int(mode) for mode in (Mode.POSITION, Mode.VELOCITY, Mode.TORQUE, Mode.RAW_POSITION))


class JointModes:
    """mode: (n,) ints of `Mode`; value: (n,) commanded velocity [rad/s] or torque [Nm], 0 in the other modes;
    in_torque: (n,) bool; is_governed: (n,) bool, in modes with collision avoidance; any_in_torque, all_in_position: of
    all joints."""

    def __init__(self, count: int) -> None:
        self.mode = np.full(count, POSITION)
        self.value = np.zeros(count)
        self._deadline = np.full(count, np.inf)
        self._may_expire = False
        self._look()

    def set(self, joints: np.ndarray, mode: Mode) -> None:
        """Put the joints of a mask (n,) into `mode`, without a command so far."""
        self.mode[joints] = mode
        self.value[joints] = 0.0
        self._deadline[joints] = np.inf
        self._look()

    def expire_at(self, index: np.ndarray, time_s: float) -> None:
        """The commands of joints `index` expire at time_s [s]."""
        self._deadline[index] = time_s
        self._may_expire = True

    def expired(self, time_s: float) -> np.ndarray | None:
        """(n,) mask of the joints whose commands have expired by time_s [s], or None if no command can expire."""
        return self._deadline <= time_s + 1e-9 if self._may_expire else None

    def settle(self) -> None:
        """Every joint is in position mode and rests."""
        self._may_expire = False

    def _look(self) -> None:
        self.in_torque = self.mode == TORQUE
        self.is_governed = (self.mode == POSITION) | (self.mode == VELOCITY)
        self.any_in_torque = bool(self.in_torque.any())
        self.all_in_position = bool((self.mode == POSITION).all())
