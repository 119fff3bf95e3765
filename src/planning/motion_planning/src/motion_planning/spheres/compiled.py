# SPDX-License-Identifier: BSD-3-Clause
"""Compilation of the inner loops of this package, and the cache of compiled code."""
from pathlib import Path

from disk_cache.compiled import compiler

_PACKAGE = Path(__file__).parents[1]

#: Decorates a function: compiled at its first call, or loaded from the cache if the files of spheres and planners have
#: not changed.
compiled = compiler("motion_planning", [_PACKAGE / "lanes.py", *_PACKAGE.glob("spheres/*.py"),
                                        *_PACKAGE.glob("planners/*.py")], nogil=True, error_model="numpy")
