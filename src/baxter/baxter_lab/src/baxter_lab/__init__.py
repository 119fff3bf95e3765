# SPDX-License-Identifier: BSD-3-Clause
"""Baxter in a world, in your own program: no ROS, no environment variables.

    from baxter_lab import Lab, pose

    with Lab() as lab:
        lab.robot.enable()
        lab.robot.left.move(pose((0.7, 0.3, 0.1)))

`Lab` is the front door; docs/python.md begins with twenty lines that pick up a block.
"""
from baxter_sim_hardware.simulated import Which
from bullet_sim import BulletSimError

from .cameras import CameraPicture
from .errors import LabError, MeshesMissing, NotReached
from .lab import Lab, Options, Thing, pose
from .robot import Arm, Baxter, BaxterState, CommandRefused, Event, Gripper, Mode, NoSolution
from .tools import Tool

__all__ = ["Arm", "Baxter", "BulletSimError", "CommandRefused", "Event", "Gripper", "Lab", "LabError", "MeshesMissing",
           "Mode", "NoSolution", "NotReached", "Options", "CameraPicture", "BaxterState", "Thing", "Tool", "Which",
           "pose"]
