# SPDX-License-Identifier: BSD-3-Clause
"""Homogeneous matrices, made readable. ROS-free."""
from __future__ import annotations

import math
from typing import Any

import numpy as np

from urdf_model.transforms import rotation_angle


class FrameMatrix:
    """The pose of frame `source` in frame `target`: the matrix that takes points from `source` to `target`."""

    def __init__(self, target: str, source: str, matrix: np.ndarray) -> None:
        """`matrix`: (4, 4), rotation and translation [m]."""
        self.target, self.source = target, source
        self.matrix = np.array(matrix, dtype=float)

    def __array__(self, dtype: Any = None) -> np.ndarray:
        return self.matrix.astype(dtype or float)

    def __repr__(self) -> str:
        rows = ["  [%s ]" % "".join("%9s" % _tidy(value) for value in row) for row in self.matrix]
        x, y, z = self.matrix[:3, 3]
        angle, axis = angle_and_axis(self.matrix[:3, :3])
        turn = "not turned" if axis is None else "turned by %.1f degrees about (%s)" % (
            math.degrees(angle), ", ".join(_tidy(value, 3) for value in axis))
        return "%s in %s:\n%s\n%s m, %s" % (self.source, self.target, "\n".join(rows),
                                            "x %s, y %s, z %s" % (_tidy(x), _tidy(y), _tidy(z)), turn)


def angle_and_axis(rotation: np.ndarray) -> tuple[float, np.ndarray | None]:
    """Return (angle [rad, 0 to pi], unit axis (3,)) of a (3, 3) rotation; the axis is None for a zero rotation."""
    angle = rotation_angle(rotation)
    if angle < 1e-6:
        return 0.0, None
    # The axis is the vector that the rotation does not change.
    _, _, rows = np.linalg.svd(rotation - np.eye(3))
    axis = rows[2]
    skew = rotation - rotation.T
    twist = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    # At half a turn both directions are valid: make the first non-zero component positive.
    reference = float(twist @ axis) if np.linalg.norm(twist) > 1e-9 else float(axis[np.argmax(np.abs(axis) > 1e-9)])
    return angle, axis if reference >= 0.0 else -axis


def _tidy(value: float, digits: int = 4) -> str:
    """A number without -0.0000."""
    text = "%.*f" % (digits, value)
    return text[1:] if float(text) == 0.0 and text.startswith("-") else text
