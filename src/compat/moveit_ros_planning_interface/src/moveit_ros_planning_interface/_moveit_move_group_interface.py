# SPDX-License-Identifier: BSD-3-Clause
"""One group, with messages as bytes."""
from __future__ import annotations

from moveit_commander import MoveGroupCommander
from moveit_commander.wrapped import WrappedGroup


class MoveGroupInterface(WrappedGroup):
    """The group ``name``; the parameters are MoveGroupCommander's. Raises RuntimeError, as that does."""

    def __init__(self, name: str, robot_description: str = "robot_description", ns: str = "",
                 wait_for_servers: float = 5.0) -> None:
        super().__init__(MoveGroupCommander(name, robot_description, ns, wait_for_servers))
