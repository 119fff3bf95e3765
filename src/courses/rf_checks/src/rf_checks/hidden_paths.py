# SPDX-License-Identifier: BSD-3-Clause
"""Parts of the workspace that the sandboxes of a check hide: no sandbox shows the solutions or the history, and a
student's program does not see the judge either."""
from __future__ import annotations

import os
from pathlib import Path

#: Paths below a workspace that contain or reveal solutions. No sandbox shows these.
SOLVED = (".git", "src/courses/rf_checks/exercises/solutions", "src/courses/rf_checks/test",
          "src/courses/rf_lab2/nodes/tf_listener.py", "src/courses/rf_lab2/nodes/wave.py", "src/courses/rf_lab2/test",
          "src/courses/rf_lab2/notebooks")
#: Paths that a student's program must not see: the judge itself.
JUDGE = ("src/courses/rf_checks",)
# The same in an install space, which may be separate from the workspace.
_INSTALLED = ("share/rf_checks/exercises/solutions", "lib/rf_lab2/tf_listener.py", "lib/rf_lab2/wave.py",
              "share/rf_lab2/notebooks")
SOLVED += tuple(place + name for place in ("", "install/") for name in _INSTALLED)
JUDGE += tuple(place + name for place in ("", "install/") for name in ("share/rf_checks", "lib/rf_checks"))


def workspace() -> Path:
    """The folder of the workspace: LAB_ROOT, or the one that this file is in."""
    return Path(os.environ.get("LAB_ROOT") or Path(__file__).resolve().parents[5])
