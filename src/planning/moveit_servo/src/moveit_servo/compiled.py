# SPDX-License-Identifier: BSD-3-Clause
"""Compilation of the inner loops of this package."""
from pathlib import Path

from disk_cache.compiled import compiler

#: Decorates a function: compiled at its first call, or loaded from the cache if the files have not changed.
compiled = compiler("moveit_servo", [Path(__file__).with_name(name) for name in ("gaps.py", "quadratic.py")],
                    nogil=True, error_model="numpy")
