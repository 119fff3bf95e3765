# SPDX-License-Identifier: BSD-3-Clause
"""How the inner loops of this package are compiled, and where what was compiled is kept."""
from pathlib import Path

from numba_cache import compiler

_PACKAGE = Path(__file__).parents[1]

#: Decorates a function: compiled when it is first called, or loaded if the files of spheres and planners are as then.
compiled = compiler("motion_planning", [*_PACKAGE.glob("spheres/*.py"), *_PACKAGE.glob("planners/*.py")],
                    nogil=True, error_model="numpy")
