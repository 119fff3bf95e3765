# SPDX-License-Identifier: BSD-3-Clause
"""Compilation of the inner loops of this package."""
from pathlib import Path

from arm_kinematics.kernels import motion
from disk_cache.compiled import compiler

#: Decorates a function: compiled at its first call, or loaded from the cache if the files have not changed.
compiled = compiler("moveit_servo", [motion.__file__, *(Path(__file__).with_name(name) for name in (
    "directions.py", "gaps.py", "limits.py", "possible.py", "quadratic.py", "straight.py"))],
    nogil=True, error_model="numpy")
