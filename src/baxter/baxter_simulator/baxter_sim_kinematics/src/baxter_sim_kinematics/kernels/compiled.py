# SPDX-License-Identifier: BSD-3-Clause
"""How the functions of this package are compiled, and where what was compiled is kept."""
from pathlib import Path

from baxter_sim_kinematics import compile_cache

compile_cache.choose()

import numba  # noqa: E402  (numba reads where its cache lies when it is imported)

# numba looks for a change of the file that a function is in, but not of the functions that it calls.
_FOLDER = compile_cache.folder("baxter_sim_kinematics", Path(__file__).parent.glob("*.py"))


def compiled(function):
    """Decorate a function: compiled when it is first called, or loaded if all of these files are as they were then."""
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _FOLDER
    try:
        # Division as the processor does it, without a check each for an exception: a tenth faster, the same bits.
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before
