# SPDX-License-Identifier: BSD-3-Clause
"""All tasks, by name."""
from .one_arm import Drawer, PickPlace, Reach
from .peg_in_hole import TwoArmPegInHole
from .task import TABLE_TOP_M, Task, robosuite_start
from .transport import TwoArmTransport
from .two_arms import TwoArmHandover, TwoArmLift

__all__ = ["TABLE_TOP_M", "TASKS", "Task", "robosuite_start"]

TASKS: dict[str, type[Task]] = {task.NAME: task for task in (
    Reach, PickPlace, Drawer, TwoArmLift, TwoArmHandover, TwoArmPegInHole, TwoArmTransport)}
