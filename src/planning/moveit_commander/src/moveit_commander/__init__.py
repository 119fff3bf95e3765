# SPDX-License-Identifier: BSD-3-Clause
"""Plan and move robots through move_group."""
# Programs end with moveit_commander.os._exit(0).
import os

from . import conversions
from .exception import MoveItCommanderException
from .interpreter import MoveGroupCommandInterpreter, MoveGroupInfoLevel
from .move_group import MoveGroupCommander
from .planning_scene_interface import PlanningSceneInterface
from .robot import RobotCommander
from .roscpp_initializer import roscpp_initialize, roscpp_shutdown

__all__ = ["MoveGroupCommandInterpreter", "MoveGroupCommander", "MoveGroupInfoLevel", "MoveItCommanderException",
           "PlanningSceneInterface", "RobotCommander", "conversions", "os", "roscpp_initialize", "roscpp_shutdown"]
