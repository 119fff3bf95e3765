# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene, with messages as bytes."""
from __future__ import annotations

from moveit_commander import PlanningSceneInterface as SceneCommander
from moveit_commander.wrapped import WrappedScene


class PlanningSceneInterface(WrappedScene):
    """ns: namespace of move_group."""

    def __init__(self, ns: str = "") -> None:
        super().__init__(SceneCommander(ns))
