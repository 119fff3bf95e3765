# SPDX-License-Identifier: BSD-3-Clause
"""Imports PyBullet without the line that it prints, which every launch and every tool would show."""

from __future__ import annotations

import importlib
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType


def _imported() -> ModuleType:
    if "pybullet" in sys.modules:
        return sys.modules["pybullet"]
    sys.stderr.flush()
    # The line is written by C to the descriptor, out of reach of sys.stderr.
    kept = os.dup(2)
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 2)
            return importlib.import_module("pybullet")
    finally:
        os.dup2(kept, 2)
        os.close(kept)


#: The module: ``from bullet_sim.quiet_pybullet import pybullet``.
pybullet = _imported()
