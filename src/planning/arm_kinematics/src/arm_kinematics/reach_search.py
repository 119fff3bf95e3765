# SPDX-License-Identifier: BSD-3-Clause
"""Which orientations an arm's tip reaches in the cells of a grid, each by a posture."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.batch import solve_batch
from arm_kinematics.budget import Budget
from arm_kinematics.reach_bounds import balls, beyond
from arm_kinematics.search import Collection, Search
from arm_kinematics.target import Target

if TYPE_CHECKING:
    from arm_kinematics.chain import Chain
    from arm_kinematics.reach import PoseChecker

TOLERANCE = 1e-5  # [m] and [rad]
# Starts for another posture of a pose whose first one touches, as a multiple of those of a pose: at 40 of these, 1 in
# 1,000 of Baxter's free poses is missed without it.
_MORE_STARTS = 4
# Postures that are checked for contact between two searches; the first ones are mostly free.
_CHECKED = 6


@dataclass(frozen=True)
class Reached:
    """reached: (cells, orientations) bool. postures: (cells, orientations, n), of those that are reached."""

    reached: np.ndarray
    postures: np.ndarray


def search_cells(chain: Chain, cells: np.ndarray, centres: np.ndarray, rotations: np.ndarray, starts: int,
                 checker: PoseChecker | None = None) -> Reached:
    """Return the Reached of cells at ``centres`` (m, 3) [m] for ``rotations`` (k, 3, 3) of the tip, base frame.

    ``cells``: (m, 3) int, the indices of the cells in their grid: a pose that is not reached by ``starts`` starts is
    tried from the postures of neighbouring cells, too. ``checker``: see :class:`reach.PoseChecker`; then only postures
    without contact count.
    """
    search = _CellSearch(chain, _neighbours(cells), centres, rotations, starts)
    search.find_postures()
    if checker is not None:
        search.keep_free(checker)
    return Reached(search.reached, search.postures)


def _neighbours(cells: np.ndarray) -> list[list[int]]:
    """Return, for each of ``cells`` (m, 3), the numbers of those that share a face with it."""
    number = {tuple(cell): k for k, cell in enumerate(cells.tolist())}
    steps = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))
    return [[number[there] for step in steps
             if (there := tuple(a + b for a, b in zip(cell, step, strict=True))) in number]
            for cell in cells.tolist()]


class _CellSearch:
    def __init__(self, chain: Chain, neighbours: list[list[int]], centres: np.ndarray, rotations: np.ndarray,
                 starts: int) -> None:
        self._chain, self._neighbours, self._centres, self._rotations = chain, neighbours, centres, rotations
        self._budget = Budget(candidates=1, max_starts=starts, tolerance_m=TOLERANCE, tolerance_rad=TOLERANCE)
        self._once = replace(self._budget, max_starts=1)
        shape = (len(centres), len(rotations))
        self.reached = np.zeros(shape, dtype=bool)
        self.postures = np.zeros((*shape, len(chain)))
        self._open = np.zeros(shape, dtype=bool)  # poses that may be reached and are not yet

    def _poses(self, where: tuple[np.ndarray, ...]) -> np.ndarray:
        """Return the poses (m, 4, 4) of ``where``, two arrays (m,) of cells and orientations."""
        poses = np.tile(np.eye(4), (len(where[0]), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = self._rotations[where[1]], self._centres[where[0]]
        return poses

    def find_postures(self) -> None:
        everything = tuple(part.ravel() for part in np.indices(self.reached.shape))
        outside = beyond(balls(self._chain), self._poses(everything))
        where = tuple(part[~outside] for part in everything)
        self._open[where] = True
        self._solve(where, self._chain.mid_range, self._budget)
        self._spread(self._solve_from)

    def _solve(self, where: tuple[np.ndarray, ...], seeds: np.ndarray, budget: Budget) -> None:
        """Search for postures, as near the middle of the joints' ranges as the search finds them."""
        if not len(where[0]):
            return
        found = solve_batch(self._chain, self._poses(where), seeds, postures=self._chain.mid_range, budget=budget,
                            threads=1)
        solved = tuple(part[found.solved] for part in where)
        self._take(solved, found.q[found.solved])

    def _take(self, where: tuple[np.ndarray, ...] | tuple[int, int], postures: np.ndarray) -> None:
        self.reached[where], self._open[where] = True, False
        self.postures[where] = postures

    def _spread(self, search: Callable[[int, int, np.ndarray], None]) -> None:
        """Try open poses from reached ones of the same orientation in neighbouring cells, until no more are reached."""
        new = self.reached.copy()
        while new.any():
            before = self.reached.copy()
            for here, orientation in np.argwhere(new).tolist():
                for cell in self._neighbours[here]:
                    if self._open[cell, orientation]:
                        search(cell, orientation, self.postures[here, orientation])
            new = self.reached & ~before

    def _solve_from(self, cell: int, orientation: int, seed: np.ndarray) -> None:
        self._solve((np.array([cell]), np.array([orientation])), seed, self._once)

    def keep_free(self, checker: PoseChecker) -> None:
        """Of the reached poses, keep those with a posture without contact, and look for other postures of the rest."""
        self._checker = checker
        where = np.argwhere(self.reached)
        self.reached[:], self._open[:] = False, False
        touching = []
        for cell, orientation in where.tolist():
            q = self.postures[cell, orientation]
            touch, is_fixed = checker.contact_and_cause(self._chain.joint_names, q)
            if touch is None:
                self.reached[cell, orientation] = True
            elif not is_fixed:
                touching.append((cell, orientation))
        for cell, orientation in touching:
            self._open[cell, orientation] = True
            self._other_posture(cell, orientation)
        self._spread(self._free_from)

    def _search_of(self, cell: int, orientation: int, seed: np.ndarray, budget: Budget) -> Search:
        pose = self._poses((np.array([cell]), np.array([orientation])))[0]
        return Search(self._chain, Target(pose), seed, None, budget)

    def _other_posture(self, cell: int, orientation: int) -> None:
        starts = _MORE_STARTS * self._budget.max_starts
        search = self._search_of(cell, orientation, self._chain.mid_range, replace(self._budget, max_starts=starts))
        solutions = np.empty((starts, len(self._chain)))
        held, start = 0, 0
        while start < starts:
            count, used, _ = search.gather(solutions[: held + _CHECKED], Collection(held, start, settle=False))
            if not used:
                break
            for q in solutions[held:count]:
                if self._checker.contact(self._chain.joint_names, q) is None:
                    self._take((cell, orientation), q)
                    return
            held, start = count, start + used

    def _free_from(self, cell: int, orientation: int, seed: np.ndarray) -> None:
        solution = np.empty((1, len(self._chain)))
        count, _, _ = self._search_of(cell, orientation, seed, self._once).gather(solution, Collection(settle=False))
        if count and self._checker.contact(self._chain.joint_names, solution[0]) is None:
            self._take((cell, orientation), solution[0])
