# SPDX-License-Identifier: BSD-3-Clause
"""The common part of the robot and the device: a connection to rosbridge, and the numbers of `wire.NUMBERS`."""
from __future__ import annotations

from typing import Any

from . import wire
from .rosbridge import RosbridgeClient


class OverRosbridge:
    """A base in front of LeRobot's own class."""

    _bridge: RosbridgeClient | None = None

    @property
    def action_features(self) -> dict[str, Any]:
        """{number: float}."""
        return dict.fromkeys(wire.NUMBERS, float)

    @property
    def is_connected(self) -> bool:
        """Whether rosbridge is."""
        return self._bridge is not None and self._bridge.is_open

    @property
    def is_calibrated(self) -> bool:
        """Always: joints have absolute angles."""
        return True

    def calibrate(self) -> None:
        """Nothing."""

    def configure(self) -> None:
        """Nothing."""
