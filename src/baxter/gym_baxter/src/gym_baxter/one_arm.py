# SPDX-License-Identifier: BSD-3-Clause
"""Tasks of the left arm. All in `base`, SI units."""
from __future__ import annotations

import math

import numpy as np

from baxter_lab import Lab

from .bodies import STEEL, WOOD, CompositeBody, Slide, SolidPart, urdf
from .names import places, poses
from .stage import Stage
from .task import TABLE_TOP_M, Task, near, posed


class Reach(Task[Stage]):
    """The left hand goes to a point in the air."""

    NAME, STEPS = "Reach", 100
    SENTENCE = "Bring the left hand to the point."
    OBSERVED = (*places("goal"), *places("goal_from_left_hand"))
    LOW_M, HIGH_M, WITHIN_M = (0.55, 0.0, 0.0), (0.85, 0.5, 0.4), 0.03

    def begin(self, random: np.random.Generator) -> None:
        self.goal = random.uniform(self.LOW_M, self.HIGH_M)

    def observed(self) -> np.ndarray:
        return np.array([*self.goal, *(self.goal - self._hand("left"))])

    def _distance(self) -> float:
        return float(np.linalg.norm(self.goal - self._hand("left")))

    def reward(self) -> float:
        return near(self._distance(), 5.0)

    def succeeded(self) -> bool:
        return self._distance() < self.WITHIN_M


class PickPlace(Task[Stage]):
    """The left hand puts a block onto a mark on the table."""

    NAME, STEPS = "PickPlace", 400
    SENTENCE = "Put the block onto the mark on the table."
    OBSERVED = (*poses("block"), *places("goal"), *places("block_from_left_hand"))
    SIZE_M, WITHIN_M = (0.04, 0.04, 0.06), 0.03
    LOW_M, HIGH_M, APART_M = (0.60, 0.10), (0.78, 0.40), 0.12

    def build(self) -> None:
        self._table((0.6, 1.2), (0.85, 0.1))
        self._height = TABLE_TOP_M + 0.5 * self.SIZE_M[2]
        self.block = self.lab.add_box("block", self.SIZE_M, (0.7, 0.2, self._height), mass_kg=0.1, friction=1.0)

    def begin(self, random: np.random.Generator) -> None:
        place = random.uniform(self.LOW_M, self.HIGH_M)
        goal = random.uniform(self.LOW_M, self.HIGH_M)
        while np.linalg.norm(goal - place) < self.APART_M:
            goal = random.uniform(self.LOW_M, self.HIGH_M)
        self.goal = np.array([*goal, self._height])
        self.block.put((*place, self._height), float(random.uniform(-math.pi / 4, math.pi / 4)))

    def observed(self) -> np.ndarray:
        return np.array([*posed(self.block), *self.goal, *(self.block.position - self._hand("left"))])

    def reward(self) -> float:
        """A quarter for the way to the block, half for the block's way, a quarter when it lies there."""
        reached = near(float(np.linalg.norm(self.block.position - self._hand("left"))), 5.0)
        placed = near(float(np.linalg.norm(self.block.position - self.goal)), 5.0)
        return 0.25 * reached + 0.5 * placed + 0.25 * self.succeeded()

    def succeeded(self) -> bool:
        there = self.block.position - self.goal
        return bool(np.linalg.norm(there[:2]) < self.WITHIN_M and abs(there[2]) < 0.01
                    and not self.lab.robot.left.gripper.holds)


class Drawer(Task[Lab]):
    """The left hand pulls a drawer open by its handle."""

    NAME, STEPS = "Drawer", 300
    SENTENCE = "Pull the drawer open by its handle."
    OBSERVED = (*poses("cabinet"), ("drawer.open", "m"), *places("handle"), *places("handle_from_left_hand"))
    SIZE_M, WALL_M = (0.25, 0.40, 0.14), 0.012  # depth, width, height; the front looks at the robot
    BAR_M, BAR_HEIGHT_M, BEFORE_M = (0.015, 0.12, 0.015), 0.10, 0.055  # the handle's bar, before the front
    TRAVEL_M, OPEN_M = 0.20, 0.15
    FRICTION_N, DAMPING = 3.0, 5.0
    LOW_M, HIGH_M, YAW_RAD = (0.86, 0.10), (0.92, 0.30), 0.2

    def build(self) -> None:
        self._table((0.6, 1.2), (0.85, 0.1))
        depth, width, height = self.SIZE_M
        links = {"cabinet": CompositeBody(self._box((depth, width, height), 0.0), WOOD),
                 "drawer": CompositeBody([*self._box((depth - 0.03, width - 0.04, height - 0.03), -0.015),
                                          *self._handle()],
                                         STEEL, friction=1.0)}
        slide = Slide("cabinet", "drawer", (-1.0, 0.0, 0.0), self.TRAVEL_M, self.FRICTION_N, self.DAMPING)
        self.cabinet = self.lab.add_urdf("cabinet", urdf("cabinet", links, [slide]),
                                         (0.9, 0.2, TABLE_TOP_M + 0.5 * height), static=True)
        self._joint = self.cabinet.model.index(["drawer_slide"])

    def _box(self, size: tuple[float, float, float], ahead: float) -> list[SolidPart]:
        """Bottom, back and sides of a box without a lid, and without a front where it is the cabinet."""
        (x, y, z), wall = size, self.WALL_M
        parts = [SolidPart((x, y, wall), (ahead, 0.0, 0.5 * (wall - z)), 300.0),
                 SolidPart((wall, y, z), (ahead + 0.5 * (x - wall), 0.0, 0.0), 300.0)]
        return parts + [SolidPart((x, wall, z), (ahead, sign * 0.5 * (y - wall), 0.0), 300.0) for sign in (-1.0, 1.0)]

    def _handle(self) -> list[SolidPart]:
        """The front of the drawer, its handle's bar, and what holds the bar."""
        depth, width, height = self.SIZE_M
        front, bar = -0.5 * (depth + self.WALL_M), self._bar()
        found = [SolidPart((self.WALL_M, width, height), (front, 0.0, 0.0), 300.0), SolidPart(self.BAR_M, bar, 300.0)]
        return found + [SolidPart((self.BEFORE_M, 0.01, 0.01), (bar[0] + 0.5 * self.BEFORE_M, sign * 0.055, bar[2]),
                                  300.0)
                        for sign in (-1.0, 1.0)]

    def _bar(self) -> tuple[float, float, float]:
        """(3,) the bar's middle in the drawer's frame."""
        return (-0.5 * self.SIZE_M[0] - self.WALL_M - self.BEFORE_M, 0.0, self.BAR_HEIGHT_M - 0.5 * self.SIZE_M[2])

    def begin(self, random: np.random.Generator) -> None:
        x, y = random.uniform(self.LOW_M, self.HIGH_M)
        self.cabinet.model.set_joint_positions(self._joint, np.zeros(1))
        self.cabinet.put((x, y, TABLE_TOP_M + 0.5 * self.SIZE_M[2]), float(random.uniform(-self.YAW_RAD, self.YAW_RAD)))

    def opened(self) -> float:
        """How far it is open [m]."""
        return float(self.cabinet.model.read_joints()[0][self._joint[0]])

    def handle(self) -> np.ndarray:
        """(3,) the middle of the handle's bar [m]."""
        bar = self._bar()
        return (self.cabinet.pose @ (bar[0] - self.opened(), *bar[1:], 1.0))[:3]

    def observed(self) -> np.ndarray:
        handle = self.handle()
        return np.array([*posed(self.cabinet), self.opened(), *handle, *(handle - self._hand("left"))])

    def reward(self) -> float:
        """A quarter for the way to the handle, the rest for the drawer's way."""
        reached = near(float(np.linalg.norm(self.handle() - self._hand("left"))), 5.0)
        return 0.25 * reached + 0.75 * min(max(self.opened() / self.OPEN_M, 0.0), 1.0)

    def succeeded(self) -> bool:
        return self.opened() >= self.OPEN_M
