# SPDX-License-Identifier: BSD-3-Clause
"""The robot's ROS interface as one table: the plugin opens it, the documentation lists it, tests check it."""

from __future__ import annotations

from .arms import CONTROLLERS, ArmTopics
from .collision import CollisionTopics
from .grippers import GripperTopics
from .head import HeadTopics
from .panel import PanelTopics
from .procedures import ProcedureTopics
from .robot import RobotTopics
from .row import COMPONENTS, JOINT_STATE_RATE, LATCHED
from .screen import ScreenTopics
from .sensors import SensorTopics
from .status import StatusTopics

JOINT_STATE_RATE_HZ = 50.0  # what the vendor's simulator publishes and the lab sheets print

PARTS = (RobotTopics, ArmTopics, PanelTopics, HeadTopics, GripperTopics, CollisionTopics, SensorTopics, StatusTopics,
         ScreenTopics, ProcedureTopics)
TOPICS = tuple(row for part in PARTS for row in part.TOPICS)
#: Messages of one tick on these topics are handled after all others, in this order: a stop overrides an enable, and
#: joint commands are handled after both.
HANDLED_LAST = ("set_super_reset", "set_super_enable", "set_super_stop", "joint_command", *CONTROLLERS)

#: What the effect `delay` holds up: the commands of arms.
DELAYED = ("joint_command", "inverse_dynamics_command", "command_twist_stamped", "command_velocity_tozero",
           *CONTROLLERS)


def markdown_table(namespace: str = "/robot") -> str:
    """The table as docs/interface.md prints it."""
    lines = ["| Topic | Type | Direction | Rate | Meaning |", "|---|---|---|---|---|"]
    for topic in TOPICS:
        if topic.rate == JOINT_STATE_RATE:
            rate = "%g Hz (`joint_state_rate`)" % JOINT_STATE_RATE_HZ
        elif topic.is_published and topic.rate != LATCHED:
            rate = "%g Hz" % topic.rate
        else:
            rate = topic.rate or "–"
        name = topic.name.format(**{kind: "<%s>" % kind for kind in COMPONENTS})
        lines.append("| `%s` | %s | %s | %s | %s |" % (
            name if name.startswith("/") else "%s/%s" % (namespace, name), topic.type,
            "robot publishes" if topic.is_published else "robot listens", rate, topic.meaning))
    return "\n".join(lines) + "\n"
