# SPDX-License-Identifier: BSD-3-Clause
"""A pot to lift and a hammer to hand over, with the sizes, starts and rewards of robosuite's environments; the README
says where they differ. All in `base`, SI units."""
from __future__ import annotations

import math

import numpy as np

from baxter_model import SIDES

from .bodies import STEEL, CompositeBody, SolidPart, urdf
from .names import places, poses
from .stage import Stage
from .task import TABLE_TOP_M, Task, near, posed


class TwoArmLift(Task[Stage]):
    """Both hands lift a pot by its handles."""

    NAME, POSE, STEPS = "TwoArmLift", None, 1000
    SENTENCE = "Lift the pot by both handles."
    OBSERVED = (*poses("pot"), *(name for side in SIDES for what in ("%s_handle", "%s_handle_from_hand")
                                 for name in places(what % side)))
    HALF_M, WALL_M, DENSITY = 0.07, 0.01, 1000.0
    HANDLE_M, ROD_M = 0.09, 0.02  # length and width of a handle; side of its rods
    LIFTED_M, UPRIGHT = 0.10, math.cos(math.radians(30.0))

    def build(self) -> None:
        self._table((0.8, 0.8), (0.26 + 0.4, 0.0))
        self.pot = self.lab.add_urdf("pot", urdf("pot", {"link": CompositeBody(self._parts(), STEEL)}),
                                     (0.66, 0.0, TABLE_TOP_M + self.HALF_M))

    def _parts(self) -> list[SolidPart]:
        """Walls, bottom and handles; the handles are along y."""
        half, wall, rod, handle = self.HALF_M, self.WALL_M, self.ROD_M, self.HANDLE_M
        found = [((2 * half, 2 * half, wall), (0.0, 0.0, 0.5 * wall - half))]
        side = half - 0.5 * wall
        for sign in (-1.0, 1.0):
            found += [((wall, 2 * half - 2 * wall, 2 * half - wall), (sign * side, 0.0, 0.5 * wall)),
                      ((2 * half, wall, 2 * half - wall), (0.0, sign * side, 0.5 * wall))]
            out = half + 0.5 * handle
            found += [((rod, handle, rod), (across * 0.5 * (handle - rod), sign * out, half - rod))
                      for across in (-1.0, 1.0)]
            found.append(((handle, rod, rod), (0.0, sign * (half + handle + 0.5 * rod), half - rod)))
        return [SolidPart(size, place, self.DENSITY) for size, place in found]

    def begin(self, random: np.random.Generator) -> None:
        x, y = random.uniform(-0.03, 0.03, 2)
        yaw = math.pi + random.uniform(-math.pi / 3, math.pi / 3)
        self.pot.put((0.66 + float(x), float(y), TABLE_TOP_M + self.HALF_M + 1e-3), float(yaw))

    def _handles(self, pose: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """{side: (3,)} of the pot at `pose`, by default where it is. It begins turned by about half a turn, so the
        handle at -y is the left hand's."""
        pose = self.pot.pose if pose is None else pose
        out = self.HALF_M + self.HANDLE_M + 0.5 * self.ROD_M
        return {side: (pose @ (0.0, sign * out, self.HALF_M - self.ROD_M, 1.0))[:3]
                for side, sign in zip(SIDES, (-1.0, 1.0), strict=True)}

    def observed(self) -> np.ndarray:
        handles = self._handles()
        return np.array([*posed(self.pot), *(value for side in SIDES
                                               for value in (*handles[side], *(handles[side] - self._hand(side))))])

    def _lift(self) -> float:
        return float(self.pot.position[2]) - self.HALF_M - TABLE_TOP_M

    def reward(self) -> float:
        """robosuite's, divided by its greatest value, 3: lifted and upright 3; else reaching, grasps, height."""
        pose = self.pot.pose
        upright, lift = pose[2, 2] >= self.UPRIGHT, float(pose[2, 3]) - self.HALF_M - TABLE_TOP_M
        if upright and lift > self.LIFTED_M:
            return 1.0
        total = 10.0 * min(max(lift - 0.05, 0.0), 0.15) if upright else 0.0
        for side, handle in self._handles(pose).items():
            holds = self._holds(side)
            reached = 1.0 if holds else near(float(np.linalg.norm(handle - self._hand(side))), 10.0)
            total += 0.25 * holds + 0.5 * reached
        return total / 3.0

    def _holds(self, side: str) -> bool:
        return self.lab.robot.arms[side].gripper.holds

    def succeeded(self) -> bool:
        """As robosuite's: neither tilt nor grasps count."""
        return self._lift() > self.LIFTED_M


class TwoArmHandover(Task[Stage]):
    """The right hand takes a hammer from the table and gives it to the left one."""

    NAME, POSE, STEPS = "TwoArmHandover", None, 1000
    SENTENCE = "Give the hammer from the right hand to the left one."
    OBSERVED = (*poses("hammer"), *(name for side in SIDES for name in places("hammer_from_%s_hand" % side)))
    LENGTH_M, HALF_WIDTH_M, DENSITY = 0.20, 0.0175, 175.0
    HEAD_M, FRICTION = (0.05, 0.10, 0.05), 4.0
    LIFTED_M = 0.10

    def build(self) -> None:
        # A quarter of a table of 0.8 x 1.2 m, on the right.
        self._table((0.8, 0.3), (0.26 + 0.4, -0.45))
        width = 2.0 * self.HALF_WIDTH_M
        parts = [SolidPart((self.LENGTH_M, width, width), (0.0, 0.0, 0.0), self.DENSITY),
                 SolidPart(self.HEAD_M, (0.5 * (self.LENGTH_M + self.HEAD_M[0]), 0.0, 0.0), self.DENSITY)]
        self.hammer = self.lab.add_urdf("hammer",
                                        urdf("hammer", {"link": CompositeBody(parts, friction=self.FRICTION)}),
                                        (0.6, -0.45, TABLE_TOP_M + 0.5 * self.HEAD_M[2]))

    def begin(self, random: np.random.Generator) -> None:
        x, y = random.uniform(-0.1, 0.1), random.uniform(-0.05, 0.05)
        self.hammer.put((0.6 + x, -0.45 + y, TABLE_TOP_M + 0.5 * self.HEAD_M[2] + 1e-3),
                        float(random.uniform(-math.pi, math.pi)))

    def observed(self) -> np.ndarray:
        return np.array([*posed(self.hammer), *(value for side in SIDES
                                                  for value in self.hammer.position - self._hand(side))])

    def _holding(self) -> dict[str, bool]:
        """{side: whether it holds something}; the hammer is all there is."""
        return {side: self.lab.robot.arms[side].gripper.holds for side in SIDES}

    def _lifted(self) -> bool:
        return float(self.hammer.position[2]) - TABLE_TOP_M > self.LIFTED_M

    def reward(self) -> float:
        """robosuite's stages, divided by its greatest value, 2."""
        holding, lifted = self._holding(), self._lifted()
        if self.succeeded():
            return 1.0
        if all(holding.values()):
            return 1.5 / 2.0 if lifted else 1.0 / 2.0
        if holding["right"]:
            reached = 0.25 * near(float(np.linalg.norm(self.hammer.position - self._hand("left"))), 1.0)
            return (1.0 + reached if lifted else 0.5) / 2.0
        return 0.25 * near(float(np.linalg.norm(self.hammer.position - self._hand("right"))), 1.0) / 2.0

    def succeeded(self) -> bool:
        holding = self._holding()
        return holding["left"] and not holding["right"] and self._lifted()
