# SPDX-License-Identifier: BSD-3-Clause
"""A row of the interface table, and the base class of parts with rows."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from types import MethodType
from typing import Final, Literal

from baxter_model import JOINTS, SIDES
from baxter_sim_hardware.sensing.panel import ANALOG, DIGITAL, NAVIGATORS

STATE_RATE_HZ = 100.0  # the physical robot's state topics
LATCHED: Final = "latched"  # in place of a rate: published once, and again to each later subscriber
JOINT_STATE_RATE: Final = "joint_state_rate"  # in place of a rate: the parameter of that name
ASSEMBLIES = (*SIDES, "head", "torso")
COMPONENTS = {"limb": SIDES, "digital": tuple(DIGITAL), "analog": tuple(ANALOG), "navigator": NAVIGATORS,
              "assembly": ASSEMBLIES, "joint": JOINTS}


@dataclass(frozen=True)
class TopicRow:
    """One row.

    key: short name, used in log lines. name: below the robot's namespace unless it begins with a slash, with one of
    COMPONENTS in braces if each has its own topic. rate: Hz, or LATCHED, or JOINT_STATE_RATE; None for topics that the
    robot subscribes to. function: the method of a `RobotPart` behind the topic. Its arguments are

    - (time_s, component, snapshot) for a topic with a rate; it returns the message;
    - (publisher) for a latched topic; it is called once and publishes on its own;
    - (component, message, time_s) for a topic that the robot subscribes to; it raises CommandRefused.

    component: one of COMPONENTS, None for a single topic, (limb, joint) for a topic of each joint; snapshot:
    `snapshot.JointSnapshot`.
    """

    key: str
    name: str
    type: str
    rate: float | Literal["latched", "joint_state_rate"] | None
    function: Callable
    meaning: str

    @property
    def is_published(self) -> bool:
        return self.rate is not None

    def names(self) -> list[tuple[str | tuple[str, ...] | None, str]]:
        """[(component or None, topic name)], one for each limb, navigator ... that has its own topic."""
        kinds = [kind for kind in COMPONENTS if "{%s}" % kind in self.name]
        names = []
        for components in itertools.product(*(COMPONENTS[kind] for kind in kinds)):
            component = components if len(kinds) > 1 else components[0] if kinds else None
            names.append((component, self.name.format(**dict(zip(kinds, components, strict=True)))))
        return names


class RobotPart:
    """A part of the robot that has topics. TOPICS: its rows; their functions are methods of this class."""

    TOPICS: tuple[TopicRow, ...] = ()

    @property
    def publishers(self) -> dict[str, MethodType]:
        """{key: bound function} of the rows that the robot publishes."""
        return {row.key: MethodType(row.function, self) for row in self.TOPICS if row.is_published}

    @property
    def handlers(self) -> dict[str, MethodType]:
        """{key: bound function} of the rows that the robot subscribes to."""
        return {row.key: MethodType(row.function, self) for row in self.TOPICS if not row.is_published}

    def reset(self) -> None:
        """The world went back to its start."""
