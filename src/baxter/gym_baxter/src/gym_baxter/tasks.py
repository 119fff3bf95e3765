# SPDX-License-Identifier: BSD-3-Clause
"""All tasks, by name."""
from baxter_lab import Lab

from .one_arm import Drawer, PickPlace, Reach
from .peg_in_hole import TwoArmPegInHole
from .stage import Stage
from .task import TABLE_TOP_M, Task, robosuite_start
from .transport import TwoArmTransport
from .two_arms import TwoArmHandover, TwoArmLift

__all__ = ["STAGE_TASKS", "TABLE_TOP_M", "TASKS", "Task", "robosuite_start"]

TASKS: dict[str, type[Task[Stage]] | type[Task[Lab]]] = {task.NAME: task for task in (
    Reach, PickPlace, Drawer, TwoArmLift, TwoArmHandover, TwoArmPegInHole, TwoArmTransport)}
#: Those that need no more than a `Stage`: on other robots, too.
STAGE_TASKS: dict[str, type[Task[Stage]]] = {task.NAME: task for task in (Reach, PickPlace, TwoArmLift, TwoArmHandover)}
