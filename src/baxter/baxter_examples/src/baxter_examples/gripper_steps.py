# SPDX-License-Identifier: BSD-3-Clause
"""Change a gripper's parameters and position step by step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from baxter_interface import Gripper


class GripperSteps:
    """A Gripper, with `change` and `move` besides its own methods."""

    def __init__(self, gripper: Gripper) -> None:
        self._gripper = gripper

    def __getattr__(self, name: str) -> Any:
        return getattr(self._gripper, name)

    def change(self, parameter: str, step: float) -> None:
        """Add `step` [%] to the parameter, within 0 to 100; a gripper without the parameter logs that."""
        value = self._gripper.parameters().get(parameter, 0.0) + step
        self._gripper.set_parameters({parameter: max(0.0, min(100.0, value))})

    def move(self, step: float) -> None:
        """Move by `step` [%] from the present position, within 0 to 100."""
        self._gripper.command_position(max(0.0, min(100.0, self._gripper.position() + step)))
