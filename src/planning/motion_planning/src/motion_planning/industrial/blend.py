# SPDX-License-Identifier: BSD-3-Clause
"""A rounded corner between two commands: the second begins while the first still slows down."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.industrial.curves import Spline
from motion_planning.industrial.profile import WINDOW_S
from motion_planning.timing import Timed
from urdf_model.transforms import rigid

if TYPE_CHECKING:
    from motion_planning.cartesian import Line, LineFollower
    from motion_planning.industrial.curves import Arc
    from motion_planning.industrial.limits import CartesianLimits
    from motion_planning.industrial.sequence import SequencePiece

# Points of a corner: greatest distance in time [s], and least number.
_SPACING_S, _FEWEST = 0.25 * WINDOW_S, 16


class Blend:
    """The sum of two motions, of which the first comes to rest in the corner where the second starts from rest.

    overlap [s]; times (m,) from 0 to overlap; motion: positions, velocities, accelerations (m, k) of the joints at
    these times. If both move a link along lines or arcs, the link's positions are summed and its rotations composed,
    and the joints follow it; else the joints are summed.
    """

    def __init__(self, one: SequencePiece, other: SequencePiece, overlap: float) -> None:
        """one, other: commands in time (way, timed, profile)."""
        self.overlap = overlap
        self._ways = one.way, other.way
        self.times = np.linspace(0.0, overlap, max(_FEWEST, math.ceil(overlap / _SPACING_S)) + 1)
        late = one.timed.duration - overlap + self.times
        corner = one.way.end
        self.motion = [a + b for a, b in zip(one.timed.sampled(late), other.timed.sampled(self.times), strict=True)]
        self.motion[0] = self.motion[0] - corner
        self._poses = None
        first, second, follower = one.way.path, other.way.path, one.way.follower
        if first is not None and second is not None and follower is not None:
            self._follow((first, second), follower, one.profile.at(late)[0], other.profile.at(self.times)[0])

    def excess(self, limits: CartesianLimits) -> float:
        """The factor by which the corner must take longer to respect the limits of joints, and of the link on lines or
        arcs; 1 or less if it does. limits: CartesianLimits."""
        model, indices = self._ways[0].scene.model, self._ways[0].group.indices
        speeds, accelerations = Timed(self.times, *self.motion).peaks()
        excess = max((speeds / model.velocity[indices]).max(),
                     math.sqrt((accelerations / model.acceleration[indices]).max()))
        if self._poses is not None:
            step = self.times[1]
            velocity = np.diff(self._poses, axis=0) / step
            bend = np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() / step
            scaling = [max(getattr(way.command.query, name) for way in self._ways)
                       for name in ("velocity_scaling", "acceleration_scaling")]
            excess = max(excess, np.linalg.norm(velocity, axis=1).max() / (scaling[0] * limits.trans_velocity),
                         math.sqrt(bend / (scaling[1] * max(limits.trans_acceleration, limits.trans_deceleration))))
        return excess / 0.999

    def _follow(self, paths: tuple[Line | Arc, Line | Arc], follower: LineFollower, before: np.ndarray,
                after: np.ndarray) -> None:
        """Move the joints' sum to where the link's sum is; before, after (m,): fractions of both ways."""
        one, other = paths
        corner = one.at(1.0)
        positions, corrections = [], []
        for q, u, v in zip(self.motion[0], np.clip(before, 0.0, 1.0), np.clip(after, 0.0, 1.0), strict=True):
            a, b = one.at(u), other.at(v)
            pose = rigid(a[:3, :3] @ corner[:3, :3].T @ b[:3, :3], a[:3, 3] + b[:3, 3] - corner[:3, 3])
            positions.append(pose[:3, 3])
            corrections.append(follower.solved(pose, q) - q)
        corrections = np.array(corrections)
        corrections[[0, -1]] = 0.0
        value, slope, bend = Spline(self.times / self.overlap, corrections).at(self.times / self.overlap)
        for part, correction in zip(self.motion, (value, slope / self.overlap, bend / self.overlap**2), strict=True):
            part += correction
        self._poses = np.array(positions)
