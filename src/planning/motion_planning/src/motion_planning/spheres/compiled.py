# SPDX-License-Identifier: BSD-3-Clause
"""Compilation of the inner loops of this package, and the cache of compiled code."""
from pathlib import Path

from disk_cache.compiled import compiler

_PACKAGE = Path(__file__).parents[1]

#: Decorates a function: compiled at its first call, or loaded from the cache if none of these files, which call each
#: other, has changed.
compiled = compiler("motion_planning", [_PACKAGE / name for name in (
    "lanes.py", "planners/kernels.py", "spheres/compiled.py", "spheres/covering.py", "spheres/kernel.py",
    "spheres/world_tables.py")], nogil=True, error_model="numpy")
