# SPDX-License-Identifier: BSD-3-Clause
"""A commanded trajectory: checked points, in arrays."""
from __future__ import annotations

import collections
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from .errors import (
    MissingJoints,
    NoJointNames,
    NoPositions,
    NotFinite,
    RepeatedJoints,
    TimesNotIncreasing,
    UnknownJoints,
    WrongSize,
)
from .segment import CUBIC, LINEAR, QUINTIC

Indices = npt.NDArray[np.int_]
#: Time from start [s], positions, velocities, accelerations.
Point = tuple[float, Sequence[float], Sequence[float], Sequence[float]]
_FIELDS = ("positions", "velocities", "accelerations")


def joint_indices(names: Sequence[str], known: Sequence[str], allow_partial: bool = False) -> Indices:
    """Indices of ``names`` in ``known``: (k,) int array.

    Any order is accepted. Raises a :class:`JointNamesError` for names that are empty, repeated, unknown, or, unless
    ``allow_partial``, incomplete.
    """
    if not names:
        raise NoJointNames(known)
    index = {name: i for i, name in enumerate(known)}
    if unknown := [name for name in names if name not in index]:
        raise UnknownJoints(unknown, known)
    if repeated := [name for name, count in collections.Counter(names).items() if count > 1]:
        raise RepeatedJoints(repeated)
    if not allow_partial and len(names) < len(known):
        raise MissingJoints([name for name in known if name not in names])
    return np.array([index[name] for name in names])


class TrajectoryCommand:
    """m points for k joints, checked; no points means: stop.

    Attributes
    ----------
    joint_names : tuple of k names
    times : (m,) array
        Time from start [s], strictly increasing.
    positions, velocities, accelerations : (m, k) arrays
        [rad or m, per s, per s^2]; 0 where a point does not give them.
    degrees : (m,) array
        Which of these count, see :mod:`.segment`.
    start_time : float or None
        Time at which the time from start begins [s]; None: as soon as possible.
    """

    def __init__(self, joint_names: Iterable[str], points: Iterable[Point], start_time: float | None = None) -> None:
        """``points``: rows of (time from start, positions, velocities, accelerations); the latter two may be empty.

        Raises :class:`TimesNotIncreasing`, :class:`NoPositions`, :class:`WrongSize` or :class:`NotFinite`.
        """
        self.joint_names = tuple(joint_names)
        self.start_time = start_time
        points = list(points)
        count = len(self.joint_names)
        self.times = np.array([point[0] for point in points], dtype=float)
        if not np.isfinite(self.times).all():
            raise NotFinite(int(np.argmin(np.isfinite(self.times))), "time_from_start")
        steps = np.diff(self.times)
        if (steps <= 0.0).any():
            late = int(np.argmax(steps <= 0.0)) + 1
            raise TimesNotIncreasing(late, self.times[late], self.times[late - 1])
        self.degrees = np.array([_checked_degree(i, point, count) for i, point in enumerate(points)], dtype=int)
        nothing = (0.0,) * count
        fields = np.array([[values if len(values) else nothing for values in point[1:4]] for point in points],
                          dtype=float).reshape(len(points), 3, count)
        finite = np.isfinite(fields).all(axis=2)
        if not finite.all():
            point, field = np.argwhere(~finite)[0]
            raise NotFinite(int(point), _FIELDS[field])
        self.positions, self.velocities, self.accelerations = fields[:, 0], fields[:, 1], fields[:, 2]


def _checked_degree(index: int, point: Point, count: int) -> int:
    _, positions, velocities, accelerations = point
    if not len(positions):
        raise NoPositions(index)
    for field, values in zip(_FIELDS, (positions, velocities, accelerations), strict=True):
        if len(values) and len(values) != count:
            raise WrongSize(index, field, len(values), count)
    if not len(velocities):
        return LINEAR
    return QUINTIC if len(accelerations) else CUBIC
