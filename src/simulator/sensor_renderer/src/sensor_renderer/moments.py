# SPDX-License-Identifier: BSD-3-Clause
"""The world as sensors see it, at this moment and a little earlier. ROS-free."""
from __future__ import annotations

import collections
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.labels import Labels

if TYPE_CHECKING:
    from sensor_renderer.gl_renderer import GlRenderer
    from sensor_renderer.mirror import Mirror
    from sensor_renderer.pinhole import Pinhole
    from sensor_renderer.tiny_renderer import TinyRenderer


class DrawnMoments:
    """A mirror, what draws it, the states of the last moments, and the numbers that masks show."""

    def __init__(self, mirror: Mirror, make_renderer: Callable[[], GlRenderer | TinyRenderer],
                 labels: Labels | None = None) -> None:
        """``mirror``: :class:`sensor_renderer.mirror.Mirror`; ``make_renderer()`` -> ``GlRenderer`` or
        ``TinyRenderer``, called before the first picture; ``labels``: :class:`sensor_renderer.labels.Labels`."""
        self.mirror = mirror
        self.labels = labels or Labels()
        self._make_renderer = make_renderer
        self._renderer = None
        self._states = collections.deque()

    @property
    def renderer(self) -> GlRenderer | TinyRenderer:
        """The renderer, made at its first use."""
        if self._renderer is None:
            self._renderer = self._make_renderer()
        return self._renderer

    def remember(self, time_s: float, values: np.ndarray, keep_s: float = 0.0) -> None:
        """The state at ``time_s`` is ``values``, as in a snapshot. Earlier states stay for ``keep_s``."""
        if not self._states or self._states[-1][0] != time_s:
            self._states.append((time_s, values))
        # One state before the kept time stays: what is between two states is blended.
        while len(self._states) > 2 and self._states[1][0] <= time_s - keep_s:
            self._states.popleft()

    def forget(self) -> None:
        """The states so far belong to another scene, or to another run of the time."""
        self._states.clear()

    def is_still(self, from_s: float, to_s: float) -> bool:
        """Whether nothing has moved between these times."""
        first = self._at(from_s)
        return all(np.array_equal(values, first) for time_s, values in self._states if from_s < time_s <= to_s)

    def show(self, time_s: float) -> None:
        """Move the mirror's bodies to where they were at ``time_s``; the first or last known state stands for times
        before or after."""
        self.mirror.set_state(self._at(time_s))

    def _at(self, time_s):
        later = None
        for then_s, values in reversed(self._states):
            if then_s <= time_s:
                if later is None:
                    return values
                share = (time_s - then_s) / (later[0] - then_s)
                return blended([size for body in self.mirror.bodies.values() for size in body.sizes], values, later[1],
                               share)
            later = then_s, values
        return self._states[0][1]


class Moment:
    """The world at one time, for the sensors of one link."""

    def __init__(self, world: DrawnMoments, model: str, link: str, time_s: float) -> None:
        """``world``: :class:`DrawnMoments`, which knows a state; ``model``, ``link``: names of the sensor's body and
        link."""
        self._world, self._model, self._link, self.time_s = world, model, link, time_s

    def at(self, time_s: float) -> Moment:
        """The same at another time [s], at most as long ago as the world remembers."""
        return Moment(self._world, self._model, self._link, time_s)

    def is_still(self, seconds: float) -> bool:
        """Whether nothing has moved in the last ``seconds``."""
        return self._world.is_still(self.time_s - seconds, self.time_s)

    @property
    def link_pose(self) -> np.ndarray:
        """Pose (4, 4) of the sensor's link in the world."""
        self._world.show(self.time_s)
        return self._world.mirror.bodies[self._model].link_matrix(self._link).copy()

    def draw(self, pinhole: Pinhole, offset: np.ndarray, colour: bool,
             depth: bool) -> tuple[np.ndarray | None, np.ndarray | None]:
        """(picture, depth) as :meth:`GlRenderer.render` returns them, of a camera whose optical frame is at ``offset``
        (4, 4) in the link."""
        pose = self.link_pose @ offset
        return self._world.renderer.render(self._world.mirror, pinhole, pose, colour, depth)

    def identify(self, pinhole: Pinhole, offset: np.ndarray) -> tuple[np.ndarray, list[tuple[str, int]], np.ndarray]:
        """(numbers, links, depth) as :meth:`GlRenderer.identify` returns them, of the same camera."""
        pose = self.link_pose @ offset
        return self._world.renderer.identify(self._world.mirror, pinhole, pose)

    @property
    def labels(self) -> Labels:
        """The :class:`sensor_renderer.labels.Labels`, which know all models of this moment."""
        self._world.labels.cover(self._world.mirror.bodies)
        return self._world.labels

    def link_poses(self) -> dict[str, np.ndarray]:
        """{model's name: poses (n, 4, 4) of its links}, a copy."""
        self._world.show(self.time_s)
        return {name: body.matrices.copy() for name, body in self._world.mirror.bodies.items()}


def blended(sizes: Iterable[int], before: np.ndarray, after: np.ndarray, share: float) -> np.ndarray:
    """The values of a snapshot between two: ``share`` 0 is ``before``, 1 is ``after``. ``sizes``: number of values of
    each body, which begin with x y z and a quaternion x y z w.

    Quaternions are blended linearly and made unit again: in the hundredth of a second of an exposure that is the same
    as turning evenly.
    """
    found = before + share * (after - before)
    start = 0
    for size in sizes:
        at = slice(start + 3, start + 7)
        one, other = before[at], after[at]
        if not np.array_equal(one, other):
            turn = (1.0 - share) * one + (share if one @ other >= 0.0 else -share) * other
            found[at] = turn / np.linalg.norm(turn)
        start += size
    return found
