# SPDX-License-Identifier: BSD-3-Clause
"""A planned path as a film that is repeated."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.model import PlanningModel

#: Pause at the end before the film is repeated [s].
PAUSE_S = 1.0


class Playback:
    """A path of states.

    times (m,): ascending, from 0 [s]; postures (m, n): values of all the model's variables. moving: the links whose
    pose changes. duration [s].
    """

    def __init__(self, model: PlanningModel, times: ArrayLike, postures: ArrayLike) -> None:
        self.times, self.postures = np.asarray(times, dtype=float), np.asarray(postures, dtype=float)
        if self.postures.shape != (len(self.times), len(model.variables)) or not len(self.times):
            raise ValueError("a path needs a posture (%d,) for each of its %d times, got an array of shape %s"
                             % (len(model.variables), len(self.times), self.postures.shape))
        if not (np.isfinite(self.times).all() and np.isfinite(self.postures).all()):
            raise ValueError("a path with values that are not finite cannot be shown")
        if (np.diff(self.times) < 0.0).any():
            raise ValueError("the times of a path go backwards")
        self._model = model
        self.duration = float(self.times[-1])
        frames = np.array([model.frames(q) for q in self.postures])
        moved = np.abs(frames - frames[0]).max(axis=(0, 2, 3)) > 1e-6
        self.moving = tuple(link for link, moves in zip(model.links, moved, strict=True) if moves)
        self._frames = frames

    def at(self, elapsed: float) -> np.ndarray:
        """Return the values (n,) at ``elapsed`` [s] after the film was begun."""
        now = min(elapsed % (self.duration + PAUSE_S), self.duration)
        return np.array([np.interp(now, self.times, column) for column in self.postures.T])

    def trail(self, link: str) -> np.ndarray:
        """Return the path of ``link``, (m, 3) in the root link."""
        return self._frames[:, self._model.link_index[link], :3, 3]
