# SPDX-License-Identifier: BSD-3-Clause
"""The tools at the root and the helpers here are not installed packages: tests import them from their folders."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "tools")]
