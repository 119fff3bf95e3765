# SPDX-License-Identifier: BSD-3-Clause
"""A hammer goes from a bin with a lid, on the right, into a bin on the left, out of which a cube goes into a third one:
sizes, starts and success are those of robosuite's TwoArmTransport; the README says where it differs. All in `base`, SI
units."""
from __future__ import annotations

import math

import numpy as np

from baxter_lab import Lab, Thing
from baxter_model import SIDES

from .bodies import RED, STEEL, WOOD, CompositeBody, SolidPart, urdf
from .names import places, poses
from .task import TABLE_TOP_M, Task, posed


class TwoArmTransport(Task[Lab]):
    """Two tables: the right hand opens the bin and gives the hammer, the left one empties the other bin."""

    NAME, POSE, STEPS = "TwoArmTransport", None, 1000
    SENTENCE = "Put the hammer into the empty bin on the other table, and the cube in there into the bin for trash."
    OBSERVED = (*poses("hammer"), *poses("trash"), *poses("lid"), *places("target_bin"), *places("trash_bin"),
                ("hammer.in_target_bin", ""), ("trash.in_trash_bin", ""),
                *(name for side in SIDES for name in places("hammer_from_%s_hand" % side)),
                *places("lid_from_right_hand"), *places("trash_from_left_hand"))
    TABLE_M, TABLE_X_M, TABLE_Y_M = (0.8, 0.3), 0.66, 0.45
    BIN_M, WALL_M = (0.3, 0.3, 0.15), 0.01
    LID_M, LID_DENSITY, KNOB_M, KNOB_DENSITY = (0.3, 0.3, 0.01), 250.0, (0.02, 0.08, 0.03), 500.0
    HANDLE_M, HALF_WIDTH_M, DENSITY, HEAD_DENSITY, FRICTION = 0.20, 0.015, 150.0, 225.0, 4.0
    HEAD_M = (0.033, 0.066, 0.033)  # along the handle, and across
    CUBE_M = 0.04
    APART_M = 0.2  # of the bins from the middle of their table
    JITTER_M, YAW_RAD, CUBE_YAW_RAD = 0.005, math.pi / 6.0, 0.3 * math.pi
    _ON_BASE_M = 0.004  # a point of contact is on the bottom of a bin if it is no higher than this above it

    def build(self) -> None:
        for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
            self._table(self.TABLE_M, (self.TABLE_X_M, sign * self.TABLE_Y_M), "%s_table" % side)
        self.bins = {name: self._bin(name, x, sign * self.TABLE_Y_M) for name, x, sign in (
            ("start_bin", self.APART_M, -1.0), ("target_bin", -self.APART_M, 1.0), ("trash_bin", self.APART_M, 1.0))}
        lid, knob = self.LID_M, self.KNOB_M
        self.lid = self.lab.add_urdf("lid", urdf("lid", {"lid": CompositeBody([
            SolidPart(lid, (0.0, 0.0, 0.0), self.LID_DENSITY),
            SolidPart(knob, (0.0, 0.0, 0.5 * (lid[2] + knob[2])), self.KNOB_DENSITY)], STEEL)}), (0.86, -0.45, 0.1))
        width = 2.0 * self.HALF_WIDTH_M
        self.hammer = self.lab.add_urdf("hammer", urdf("hammer", {"hammer": CompositeBody([
            SolidPart((self.HANDLE_M, width, width), (0.0, 0.0, 0.0), self.DENSITY),
            SolidPart(self.HEAD_M, (0.5 * (self.HANDLE_M + self.HEAD_M[0]), 0.0, 0.0), self.HEAD_DENSITY)],
            WOOD, self.FRICTION)}), (0.86, -0.45, 0.0))
        self.trash = self.lab.add_urdf("trash", urdf("trash", {"trash": CompositeBody([
            SolidPart((self.CUBE_M,) * 3, (0.0, 0.0, 0.0))], RED)}), (0.46, 0.45, 0.0))

    def _bin(self, name: str, x: float, y: float) -> Thing:
        length, width, height = self.BIN_M
        wall = self.WALL_M
        parts = [SolidPart((length - wall, width - wall, wall), (0.0, 0.0, 0.5 * (wall - height)))]
        for sign in (-1.0, 1.0):
            parts += [SolidPart((wall, width, height), (sign * 0.5 * (length - wall), 0.0, 0.0)),
                      SolidPart((length, wall, height), (0.0, sign * 0.5 * (width - wall), 0.0))]
        return self.lab.add_urdf(name, urdf(name, {name: CompositeBody(parts, (0.85, 0.85, 0.88, 1.0))}),
                                 (self.TABLE_X_M + x, y, TABLE_TOP_M + 0.5 * height), static=True)

    def begin(self, random: np.random.Generator) -> None:
        def jitter():
            return random.uniform(-self.JITTER_M, self.JITTER_M, 2)

        for name, thing in self.bins.items():
            x, y = jitter()
            table = 1.0 if name != "start_bin" else -1.0
            ahead = -self.APART_M if name == "target_bin" else self.APART_M
            thing.put((self.TABLE_X_M + ahead + x, table * self.TABLE_Y_M + y, TABLE_TOP_M + 0.5 * self.BIN_M[2]))
        bottom = TABLE_TOP_M + self.WALL_M + 1e-3
        x, y, _ = self.bins["start_bin"].position
        self.lid.put((x, y, TABLE_TOP_M + self.BIN_M[2] + 0.5 * self.LID_M[2] + 1e-3))
        self.hammer.put((x - 0.5 * self.HEAD_M[0], y, bottom + 0.5 * self.HEAD_M[2]),
                        float(random.uniform(-self.YAW_RAD, self.YAW_RAD)))
        x, y, _ = self.bins["target_bin"].position
        self.trash.put((x, y, bottom + 0.5 * self.CUBE_M), float(random.uniform(-self.CUBE_YAW_RAD, self.CUBE_YAW_RAD)))

    def _is_in(self, thing: Thing, name: str) -> bool:
        """Whether a thing touches the bottom of a bin."""
        floor = TABLE_TOP_M + self.WALL_M
        return any(contact.distance <= 0.0 and contact.position[2] < floor + self._ON_BASE_M
                   for contact in self.lab.world.contacts(thing.model, self.bins[name].model))

    def observed(self) -> np.ndarray:
        hammer, trash, lid = (thing.position for thing in (self.hammer, self.trash, self.lid))
        return np.array([
            *posed(self.hammer), *posed(self.trash), *posed(self.lid), *self.bins["target_bin"].position,
            *self.bins["trash_bin"].position, self._is_in(self.hammer, "target_bin"),
            self._is_in(self.trash, "trash_bin"), *(value for side in SIDES for value in hammer - self._hand(side)),
            *(lid - self._hand("right")), *(trash - self._hand("left"))], dtype=float)

    def reward(self) -> float:
        """As robosuite's, which has no other: 1 for success."""
        return float(self.succeeded())

    def succeeded(self) -> bool:
        return self._is_in(self.hammer, "target_bin") and self._is_in(self.trash, "trash_bin")
