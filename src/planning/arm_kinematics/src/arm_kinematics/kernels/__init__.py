# SPDX-License-Identifier: BSD-3-Clause
"""Compiled inner loops: forward kinematics, Jacobian, and the search behind :func:`arm_kinematics.solve`.

Arrays and numbers that belong together are a plain tuple: passing it from Python to numba takes a third of the time of
a named one. Their parts, in order:

- arm, n joints, each turned so that it moves about (or along) its own z axis: rotations (n + 1, 3, 3) and offsets
  (n + 1, 3) [m], the constant pose of joint i's frame in the frame that joint i - 1 moves, the last entry from the last
  joint to the tip; prismatic (n,) bool;
- limits: lower, upper (n,) [rad or m], infinite where there is no limit;
- target: rotation (3, 3), position (3,), rows: the value of a :class:`Rows`, basis (3, 3): the free axis, see
  :func:`fill_basis`;
- effort: tolerances [m], [rad], iterations of one start, starts, number of starts that must arrive before a search
  ends;
- postures: seed (n,), where a search starts, and preferred (n,), which solutions should be near;
- collection, how :func:`gather` fills its rows: number of filled rows; number of the first start; whether each solution
  moves along its self-motion to the point nearest the preferred posture; least difference of two solutions in some
  joint [rad or m].

Positions are in metres and angles in radians, everything in the base frame. The functions keep no state and release the
GIL, so any number of threads may call them.
"""
from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from arm_kinematics.kernels.rows import Rows

Arm = tuple[np.ndarray, np.ndarray, np.ndarray]
Limits = tuple[np.ndarray, np.ndarray]
TargetArrays = tuple[np.ndarray, np.ndarray, int, np.ndarray]
Effort = tuple[float, float, int, int, int]
Postures = tuple[np.ndarray, np.ndarray]
Gathering = tuple[int, int, bool, float]

_HOMES = {"descent": ("nearest", "newton"), "linear": ("wrench",), "motion": ("joint_frames", "tip_and_jacobian"),
          "searching": ("gather", "search", "search_many"),
          "task": ("beyond_reach", "fill_basis", "pose_error", "split_pose")}

__all__ = ["Rows", *(name for names in _HOMES.values() for name in names)]  # noqa: PLE0604


def load() -> None:
    """Import all functions, and with them the compiler, which takes a third of a second: for programs in which the
    first use must not."""
    for module, names in _HOMES.items():
        home = importlib.import_module("%s.%s" % (__name__, module))
        globals().update((name, getattr(home, name)) for name in names)


def __getattr__(name: str) -> Callable[..., Any]:
    """The functions are imported at the first use of one of them."""
    if name not in __all__:
        raise AttributeError("module '%s' has no attribute '%s'" % (__name__, name))
    load()
    return globals()[name]
