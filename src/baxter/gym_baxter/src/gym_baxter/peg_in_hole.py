# SPDX-License-Identifier: BSD-3-Clause
"""A peg on the right hand goes into the hole of a plate on the left one: sizes, start, success and reward are those of
robosuite's TwoArmPegInHole; the README says where it differs. All in `base`, SI units."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from baxter_lab import Lab, Tool
from urdf_model.transforms import quaternion_from_matrix

from .bodies import RED, WOOD, CompositeBody, SolidPart, urdf
from .names import places, poses
from .task import Task

if TYPE_CHECKING:
    from baxter_lab import Options


class TwoArmPegInHole(Task[Lab]):
    """A plate with a hole is fixed to the left hand, a peg to the right one; there are no grippers."""

    NAME, POSE, STEPS = "TwoArmPegInHole", None, 1000
    SENTENCE = "Put the peg of the right hand into the hole of the plate on the left hand."
    OBSERVED = (*poses("hole"), *poses("peg"), *places("hole_from_peg"), ("peg_hole.cos", ""), ("peg_hole.along", "m"),
                ("peg_hole.beside", "m"))
    RADIUS_M, HALF_LENGTH_M = 0.0225, 0.13
    # The plate's parts around a hole of 10 x 10 cm; their frame is in the middle of the first.
    PLATE = (((0.12, 0.34, 0.02), (0.0, 0.0, 0.0)), ((0.12, 0.34, 0.02), (0.22, 0.0, 0.0)),
             ((0.10, 0.12, 0.02), (0.11, 0.11, 0.0)), ((0.10, 0.12, 0.02), (0.11, -0.11, 0.0)))
    PLATE_PLACE_M = (0.11, 0.0, 0.17)  # in the left hand's frame; turned by half a turn about (0, 1, 1)
    HOLE_M = (0.10, 0.0, 0.0)  # what counts as the middle of the hole, in the plate's frame
    BESIDE_M, ALONG_M, ALIGNED = 0.06, (-0.12, 0.14), 0.95

    @classmethod
    def robot(cls, options: Options) -> Options:
        peg = CompositeBody([SolidPart((cls.RADIUS_M, 2.0 * cls.HALF_LENGTH_M), (0.0, 0.0, 0.0))], RED)
        plate = CompositeBody([SolidPart(size, place) for size, place in cls.PLATE], WOOD)
        tools = (Tool("left", urdf("plate", {"plate": plate}), cls.PLATE_PLACE_M, (math.pi / 2.0, 0.0, math.pi)),
                 Tool("right", urdf("peg", {"peg": peg}), (0.0, 0.0, cls.HALF_LENGTH_M)))
        return options._replace(left_gripper="none", right_gripper="none", tools=tools)

    def _frames(self) -> tuple[np.ndarray, np.ndarray]:
        model = self.lab.robot.simulated.model
        return model.link_pose("plate").matrix(), model.link_pose("peg").matrix()

    def _fit(self, plate: np.ndarray, peg: np.ndarray) -> tuple[float, float, float]:
        """How far the hole is along the peg's axis and beside it [m], and the cosine between axis and hole."""
        axis = peg[:3, 2]
        to_hole = (plate @ (*self.HOLE_M, 1.0))[:3] - peg[:3, 3]
        along = float(to_hole @ axis)
        beside = float(np.linalg.norm(to_hole - along * axis))
        return along, beside, abs(float(plate[:3, 2] @ axis))

    def _is_in(self, along: float, beside: float, cosine: float) -> bool:
        return beside < self.BESIDE_M and self.ALONG_M[0] <= along <= self.ALONG_M[1] and cosine > self.ALIGNED

    def observed(self) -> np.ndarray:
        plate, peg = self._frames()
        along, beside, cosine = self._fit(plate, peg)
        return np.concatenate([plate[:3, 3], quaternion_from_matrix(plate), peg[:3, 3], quaternion_from_matrix(peg),
                               plate[:3, 3] - peg[:3, 3], (cosine, along, beside)])

    def reward(self) -> float:
        """robosuite's, divided by its greatest value, 5: a fifth each for the hands' distance, for the peg beside and
        along the hole, for its direction, and for success."""
        plate, peg = self._frames()
        along, beside, cosine = self._fit(plate, peg)
        apart = float(np.linalg.norm(plate[:3, 3] - peg[:3, 3]))
        shaped = 3.0 - math.tanh(apart) - math.tanh(beside) - math.tanh(abs(along)) + cosine
        return (shaped + self._is_in(along, beside, cosine)) / 5.0

    def succeeded(self) -> bool:
        return self._is_in(*self._fit(*self._frames()))
