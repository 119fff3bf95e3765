# SPDX-License-Identifier: BSD-3-Clause
"""Joint positions that put a link at a pose, as far as its joints allow it. ROS-free."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from urdf_model.transforms import axis_rotation, quaternion_from_matrix, rigid

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from urdf_model import Joint, MergedRobot

_STEPS = 100
_CLOSE = 1e-10  # [rad or m]: the change of a step that changes nothing
_DAMPING = 1e-6  # of the least squares: keeps joints still that do not matter
_FARTHEST = 0.5  # [rad or m] in one step, within which a rotation is about straight


def joints_to(merged: MergedRobot, body: str) -> list[Joint]:
    """The movable joints from the root of a ``urdf_model.MergedRobot`` to ``body``, in this order."""
    by_child = {joint.child: joint for joint in merged.joints.values()}
    chain = []
    while body != merged.root:
        chain.append(by_child[body])
        body = chain[-1].parent
    return chain[::-1]


def placed(joints: Sequence[Joint], base: np.ndarray, wanted: np.ndarray, start: npt.ArrayLike, lower: npt.ArrayLike,
           upper: npt.ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """(positions (n,), Jacobian (6, n)) that put the body behind ``joints`` as near as possible to ``wanted`` (4, 4), a
    radian as far as a metre; ``base`` (4, 4): the root; ``start``, ``lower``, ``upper`` (n,) [rad or m]."""
    position = np.clip(np.asarray(start, dtype=float), lower, upper)
    for _ in range(_STEPS):
        place, jacobian = _behind(joints, base, position)
        error = np.concatenate([wanted[:3, 3] - place[:3, 3], _turn(wanted[:3, :3] @ place[:3, :3].T)])
        change = np.linalg.solve(jacobian.T @ jacobian + _DAMPING * np.eye(len(joints)), jacobian.T @ error)
        moved = np.clip(position + np.clip(change, -_FARTHEST, _FARTHEST), lower, upper)
        done = np.abs(moved - position).max() < _CLOSE
        position = moved
        if done:
            break
    return position, _behind(joints, base, position)[1]


def rates(jacobian: np.ndarray, linear: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """The rates (n,) of joints that move the body behind them as nearly as possible at a velocity [m/s, rad/s]."""
    return np.linalg.lstsq(jacobian, np.concatenate([linear, angular]), rcond=1e-6)[0]


def _behind(joints: Sequence[Joint], base: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The frame (4, 4) of the body behind the joints, and how it moves with them: (6, n), linear above angular."""
    place, axes = base, []
    for joint, value in zip(joints, position, strict=True):
        place = place @ joint.origin
        axes.append((joint.type == "prismatic", place[:3, :3] @ joint.axis, place[:3, 3]))
        slides = joint.type == "prismatic"
        place = place @ (rigid(np.eye(3), joint.axis * value) if slides
                         else rigid(axis_rotation(joint.axis, value), (0.0, 0.0, 0.0)))
    columns = [np.concatenate([axis, np.zeros(3)] if slides else [np.cross(axis, place[:3, 3] - at), axis])
               for slides, axis, at in axes]
    return place, np.array(columns).T


def _turn(rotation: np.ndarray) -> np.ndarray:
    """Axis times angle of a rotation (3, 3)."""
    x, y, z, w = quaternion_from_matrix(rotation)
    sine = math.sqrt(x * x + y * y + z * z)
    return np.array([x, y, z]) * (2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0)
