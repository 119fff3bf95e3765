# SPDX-License-Identifier: BSD-3-Clause
"""Named postures of the arms, from poses.yaml beside this file (which explains its own layout)."""
from __future__ import annotations

import functools
import pathlib
from typing import Any

from .errors import PoseError
from .names import JOINTS, mirrored, named


class Poses:
    """Joint angles by pose name, for every side.

    table: {pose: {side: {joint without its side: angle [rad]}}}, as below `poses` in poses.yaml. Raises PoseError where
    a joint is missing.
    """

    def __init__(self, table: dict[str, dict[str, dict[str, float]]]) -> None:
        self._table = table
        for name, pose in table.items():
            for given in pose.values():
                if set(given) != set(JOINTS):
                    raise PoseError("pose '%s' gives %s; it must give %s" % (name, ", ".join(given), ", ".join(JOINTS)))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all poses: tuple."""
        return tuple(self._table)

    def angles(self, name: str, side: str) -> dict[str, float]:
        """{joint name: angle [rad]} of one arm; a missing side is the mirror image of the other.

        Raises PoseError for an unknown pose.
        """
        try:
            pose = self._table[name]
        except KeyError:
            raise PoseError("unknown pose '%s'; choices are %s" % (name, ", ".join(self._table))) from None
        return named(side, pose[side] if side in pose else mirrored(next(iter(pose.values()))))

    def extended(self, table: dict[str, dict[str, dict[str, float]]]) -> Poses:
        """Return Poses with those of another table added; a pose of the same name replaces ours.

        Raises PoseError where a joint is missing.
        """
        return Poses({**self._table, **table})


@functools.cache
def _file() -> Any:
    # Imported here: it loads slower than the whole package, and most programs need only names.
    import yaml
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    with open(pathlib.Path(__file__).with_name("poses.yaml")) as stream:
        return yaml.load(stream, loader)


@functools.cache
def poses() -> Poses:
    """Return the robot's Poses: start, neutral, zero, tucked, untucked. The file is read by the first call."""
    return Poses(_file()["poses"])


def null_space_postures(side: str) -> dict[str, dict[str, float]]:
    """{name: {joint name: angle [rad]}} of one arm: the postures that inverse kinematics starts from."""
    table = _file()["null_space"]
    every = poses().extended(table["postures"])
    return {name: every.angles(name, side) for name in (*table["poses"], *table["postures"])}


def clamp_to_limits(angles: dict[str, float], limits: dict[str, tuple[float, float]]) -> dict[str, float]:
    """{joint: angle} brought inside {joint: (lower, upper)} [rad]; joints without an entry are left as they are."""
    return {joint: min(max(angle, limits[joint][0]), limits[joint][1]) if joint in limits else angle
            for joint, angle in angles.items()}
