# SPDX-License-Identifier: BSD-3-Clause
"""The tools at the root of the workspace are no installed package; their tests import them from their folder."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
