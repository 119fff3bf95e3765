# SPDX-License-Identifier: BSD-3-Clause
"""The base of all tasks. All in `base`, SI units."""
from __future__ import annotations

import math
from typing import Generic, TypeVar

import numpy as np

from baxter_lab import Options
from baxter_model import BASE_HEIGHT_M, MIRROR_SIGNS

from .names import Named
from .stage import Stage, StageThing

#: Where arms begin in robosuite's tasks, right arm, s0 s1 e0 e1 w0 w1 w2 [rad]; the left one mirrors it.
ROBOSUITE_RIGHT = (0.403, -0.636, 0.114, 1.432, 0.735, 1.205, -0.269)
TABLE_TOP_M = 0.8 - BASE_HEIGHT_M  # in `base`: robosuite's tables are 0.8 m high
_TABLE_COLOUR = (0.76, 0.70, 0.60, 1.0)

#: What a task needs: a `Stage`, or all of `baxter_lab.Lab`.
LabT = TypeVar("LabT", bound=Stage)


def robosuite_start() -> dict[str, np.ndarray]:
    """{side: (7,) [rad]}."""
    right = np.array(ROBOSUITE_RIGHT)
    return {"left": right * list(MIRROR_SIGNS.values()), "right": right}


class Task(Generic[LabT]):
    """Base of all tasks. `lab`: the lab that `build` furnishes once; `begin` starts an episode by `random`."""

    NAME = ""
    SENTENCE = ""  # the task in words
    OBSERVED: tuple[Named, ...] = ()  # names and units of what `observed` returns
    POSE: str | None = "neutral"  # that the arms begin in; None: robosuite's
    STEPS = 400  # of an episode

    @classmethod
    def robot(cls, options: Options) -> Options:
        """The robot that the task needs, made of the one that was asked for."""
        return options

    def __init__(self, lab: LabT) -> None:
        self.lab = lab
        self.build()

    def build(self) -> None:
        """Put up what stands there in every episode."""

    def begin(self, random: np.random.Generator) -> None:
        """Put all things where an episode begins."""

    def observed(self) -> np.ndarray:
        """The observation beside the robot's own: positions [m], quaternions, goals."""
        raise NotImplementedError

    def reward(self) -> float:
        """The worth of the present state, 0 to 1."""
        raise NotImplementedError

    def succeeded(self) -> bool:
        """Whether it is done."""
        raise NotImplementedError

    def _hand(self, side: str) -> np.ndarray:
        return self.lab.robot.arms[side].pose[:3, 3]

    def _table(self, size: tuple[float, float], place: tuple[float, float], name: str = "table") -> None:
        """A table: size (length, width), place (x, y) of its middle [m]."""
        self.lab.add_box(name, (*size, 0.05), (*place, TABLE_TOP_M - 0.025), colour=_TABLE_COLOUR)


def posed(thing: StageThing) -> list[float]:
    """Its place [m] and quaternion x y z w."""
    pose = thing.model.base_pose()
    return [*pose.position, *pose.quaternion]


def near(distance: float, slope: float) -> float:
    """1 at no distance [m], 0 far away."""
    return 1.0 - math.tanh(slope * distance)
