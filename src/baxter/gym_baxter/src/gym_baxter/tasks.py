# SPDX-License-Identifier: BSD-3-Clause
"""The tasks: what stands there, where it begins, when it is done, what it is worth.

TwoArmLift and TwoArmHandover have the sizes, starts and rewards of robosuite's environments of these names; the README
says where they differ. All in `base`, SI units.
"""
from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np

from baxter_lab import Lab
from baxter_model import BASE_HEIGHT_M, MIRROR_SIGNS, SIDES

from .names import Named, places, poses

#: Where arms begin in robosuite's tasks, right arm, s0 s1 e0 e1 w0 w1 w2 [rad]; the left one mirrors it.
ROBOSUITE_RIGHT = (0.403, -0.636, 0.114, 1.432, 0.735, 1.205, -0.269)
TABLE_TOP_M = 0.8 - BASE_HEIGHT_M  # in `base`: robosuite's tables are 0.8 m high
_TABLE_COLOUR = (0.76, 0.70, 0.60, 1.0)


def robosuite_start() -> dict[str, np.ndarray]:
    """{side: (7,) [rad]}."""
    right = np.array(ROBOSUITE_RIGHT)
    return {"left": right * list(MIRROR_SIGNS.values()), "right": right}


class Task:
    """Base of all tasks. `lab`: the `Lab` that `build` furnishes once; `begin` starts an episode by `random`."""

    NAME = ""
    SENTENCE = ""  # the task in words
    OBSERVED: tuple[Named, ...] = ()  # names and units of what `observed` returns
    POSE = "neutral"  # that the arms begin in; None: robosuite's
    STEPS = 400  # of an episode

    def __init__(self, lab: Lab):
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

    def _hand(self, side):
        return self.lab.robot.arms[side].pose[:3, 3]

    def _table(self, length, width, x, y=0.0):
        self.lab.add_box("table", (length, width, 0.05), (x, y, TABLE_TOP_M - 0.025), colour=_TABLE_COLOUR)


def _posed(thing):
    pose = thing.model.base_pose()
    return [*pose.position, *pose.quaternion]


def _near(distance, slope):
    return 1.0 - math.tanh(slope * distance)


class Reach(Task):
    """The left hand goes to a point in the air."""

    NAME, STEPS = "Reach", 100
    SENTENCE = "Bring the left hand to the point."
    OBSERVED = (*places("goal"), *places("goal_from_left_hand"))
    LOW_M, HIGH_M, WITHIN_M = (0.55, 0.0, 0.0), (0.85, 0.5, 0.4), 0.03

    def begin(self, random):
        self.goal = random.uniform(self.LOW_M, self.HIGH_M)

    def observed(self):
        return np.array([*self.goal, *(self.goal - self._hand("left"))])

    def _distance(self):
        return float(np.linalg.norm(self.goal - self._hand("left")))

    def reward(self):
        return _near(self._distance(), 5.0)

    def succeeded(self):
        return self._distance() < self.WITHIN_M


class PickPlace(Task):
    """The left hand puts a block onto a mark on the table."""

    NAME, STEPS = "PickPlace", 400
    SENTENCE = "Put the block onto the mark on the table."
    OBSERVED = (*poses("block"), *places("goal"), *places("block_from_left_hand"))
    SIZE_M, WITHIN_M = (0.04, 0.04, 0.06), 0.03
    LOW_M, HIGH_M, APART_M = (0.60, 0.10), (0.78, 0.40), 0.12

    def build(self):
        self._table(0.6, 1.2, 0.85, 0.1)
        self._height = TABLE_TOP_M + 0.5 * self.SIZE_M[2]
        self.block = self.lab.add_box("block", self.SIZE_M, (0.7, 0.2, self._height), mass_kg=0.1, friction=1.0)

    def begin(self, random):
        place = random.uniform(self.LOW_M, self.HIGH_M)
        goal = random.uniform(self.LOW_M, self.HIGH_M)
        while np.linalg.norm(goal - place) < self.APART_M:
            goal = random.uniform(self.LOW_M, self.HIGH_M)
        self.goal = np.array([*goal, self._height])
        self.block.put((*place, self._height), float(random.uniform(-math.pi / 4, math.pi / 4)))

    def observed(self):
        return np.array([*_posed(self.block), *self.goal, *(self.block.position - self._hand("left"))])

    def reward(self):
        """A quarter for the way to the block, half for the block's way, a quarter when it lies there."""
        reached = _near(float(np.linalg.norm(self.block.position - self._hand("left"))), 5.0)
        placed = _near(float(np.linalg.norm(self.block.position - self.goal)), 5.0)
        return 0.25 * reached + 0.5 * placed + 0.25 * self.succeeded()

    def succeeded(self):
        there = self.block.position - self.goal
        return bool(np.linalg.norm(there[:2]) < self.WITHIN_M and abs(there[2]) < 0.01
                    and not self.lab.robot.left.gripper.holds)


def _robot_text(name, boxes, masses):
    """URDF of one body made of boxes: [(size (3,), centre (3,))]."""
    robot = ElementTree.Element("robot", name=name)
    link = ElementTree.SubElement(robot, "link", name="link")
    total = sum(masses)
    centre = sum(mass * np.array(place) for mass, (_, place) in zip(masses, boxes, strict=True)) / total
    inertia = np.zeros((3, 3))
    for mass, (size, place) in zip(masses, boxes, strict=True):
        square, off = np.square(size), np.array(place) - centre
        inertia += mass * (np.diag(square.sum() - square) / 12.0 + (off @ off) * np.eye(3) - np.outer(off, off))
    element = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(element, "origin", xyz="%r %r %r" % tuple(map(float, centre)))
    ElementTree.SubElement(element, "mass", value=repr(float(total)))
    ElementTree.SubElement(element, "inertia", **{
        "i" + "xyz"[a] + "xyz"[b]: repr(float(inertia[a, b])) for a in range(3) for b in range(a, 3)})
    for size, place in boxes:
        for tag in ("visual", "collision"):
            shape = ElementTree.SubElement(link, tag)
            ElementTree.SubElement(shape, "origin", xyz="%g %g %g" % tuple(place))
            ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), "box", size="%g %g %g" % tuple(size))
    return ElementTree.tostring(robot, encoding="unicode")


class TwoArmLift(Task):
    """Both hands lift a pot by its handles."""

    NAME, POSE, STEPS = "TwoArmLift", None, 1000
    SENTENCE = "Lift the pot by both handles."
    OBSERVED = (*poses("pot"), *(name for side in SIDES for what in ("%s_handle", "%s_handle_from_hand")
                                 for name in places(what % side)))
    HALF_M, WALL_M, DENSITY = 0.07, 0.01, 1000.0
    HANDLE_M, ROD_M = 0.09, 0.02  # length and width of a handle; side of its rods
    LIFTED_M, UPRIGHT = 0.10, math.cos(math.radians(30.0))

    def build(self):
        self._table(0.8, 0.8, 0.26 + 0.4)
        boxes = self._boxes()
        masses = [self.DENSITY * float(np.prod(size)) for size, _ in boxes]
        self.pot = self.lab.add_urdf("pot", _robot_text("pot", boxes, masses), (0.66, 0.0, TABLE_TOP_M + self.HALF_M))

    def _boxes(self):
        """[(size, centre)] of walls, bottom and handles; the handles are along y."""
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
        return found

    def begin(self, random):
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

    def observed(self):
        handles = self._handles()
        return np.array([*_posed(self.pot), *(value for side in SIDES
                                               for value in (*handles[side], *(handles[side] - self._hand(side))))])

    def _lift(self):
        return float(self.pot.position[2]) - self.HALF_M - TABLE_TOP_M

    def reward(self):
        """robosuite's, divided by its greatest value, 3: lifted and upright 3; else reaching, grasps, height."""
        pose = self.pot.pose
        upright, lift = pose[2, 2] >= self.UPRIGHT, float(pose[2, 3]) - self.HALF_M - TABLE_TOP_M
        if upright and lift > self.LIFTED_M:
            return 1.0
        total = 10.0 * min(max(lift - 0.05, 0.0), 0.15) if upright else 0.0
        for side, handle in self._handles(pose).items():
            holds = self._holds(side)
            near = 1.0 if holds else _near(float(np.linalg.norm(handle - self._hand(side))), 10.0)
            total += 0.25 * holds + 0.5 * near
        return total / 3.0

    def _holds(self, side):
        return self.lab.robot.arms[side].gripper.holds

    def succeeded(self):
        """As robosuite's: neither tilt nor grasps count."""
        return self._lift() > self.LIFTED_M


class TwoArmHandover(Task):
    """The right hand takes a hammer from the table and gives it to the left one."""

    NAME, POSE, STEPS = "TwoArmHandover", None, 1000
    SENTENCE = "Give the hammer from the right hand to the left one."
    OBSERVED = (*poses("hammer"), *(name for side in SIDES for name in places("hammer_from_%s_hand" % side)))
    LENGTH_M, HALF_WIDTH_M, DENSITY = 0.20, 0.0175, 175.0
    HEAD_M = (0.05, 0.10, 0.05)
    LIFTED_M = 0.10

    def build(self):
        # A quarter of a table of 0.8 x 1.2 m, on the right.
        self._table(0.8, 0.3, 0.26 + 0.4, -0.45)
        width = 2.0 * self.HALF_WIDTH_M
        boxes = [((self.LENGTH_M, width, width), (0.0, 0.0, 0.0)),
                 (self.HEAD_M, (0.5 * (self.LENGTH_M + self.HEAD_M[0]), 0.0, 0.0))]
        masses = [self.DENSITY * float(np.prod(size)) for size, _ in boxes]
        text = _robot_text("hammer", boxes, masses).replace(
            "</robot>", '<gazebo reference="link"><mu1>4</mu1><mu2>4</mu2></gazebo></robot>')
        self.hammer = self.lab.add_urdf("hammer", text, (0.6, -0.45, TABLE_TOP_M + 0.5 * self.HEAD_M[2]))

    def begin(self, random):
        x, y = random.uniform(-0.1, 0.1), random.uniform(-0.05, 0.05)
        self.hammer.put((0.6 + x, -0.45 + y, TABLE_TOP_M + 0.5 * self.HEAD_M[2] + 1e-3),
                        float(random.uniform(-math.pi, math.pi)))

    def observed(self):
        return np.array([*_posed(self.hammer), *(value for side in SIDES
                                                  for value in self.hammer.position - self._hand(side))])

    def _holding(self):
        """{side: whether it holds something}; the hammer is all there is."""
        return {side: self.lab.robot.arms[side].gripper.holds for side in SIDES}

    def _lifted(self):
        return float(self.hammer.position[2]) - TABLE_TOP_M > self.LIFTED_M

    def reward(self):
        """robosuite's stages, divided by its greatest value, 2."""
        holding, lifted = self._holding(), self._lifted()
        if self.succeeded():
            return 1.0
        if all(holding.values()):
            return 1.5 / 2.0 if lifted else 1.0 / 2.0
        if holding["right"]:
            near = 0.25 * _near(float(np.linalg.norm(self.hammer.position - self._hand("left"))), 1.0)
            return (1.0 + near if lifted else 0.5) / 2.0
        return 0.25 * _near(float(np.linalg.norm(self.hammer.position - self._hand("right"))), 1.0) / 2.0

    def succeeded(self):
        holding = self._holding()
        return holding["left"] and not holding["right"] and self._lifted()


TASKS = {task.NAME: task for task in (Reach, PickPlace, TwoArmLift, TwoArmHandover)}
