# SPDX-License-Identifier: BSD-3-Clause
"""Import PyBullet without the line that it prints on every import, which every launch and every tool would show."""

import os
import sys


def _import():
    if "pybullet" in sys.modules:
        return
    sys.stderr.flush()
    # The line is written by C to the descriptor, out of reach of sys.stderr.
    kept = os.dup(2)
    try:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 2)
            import pybullet  # noqa: F401
    finally:
        os.dup2(kept, 2)
        os.close(kept)


_import()
