# SPDX-License-Identifier: BSD-3-Clause
"""Start and end of the C++ node that MoveIt's own commander has. Ours has none: it uses the program's rospy node."""
from __future__ import annotations

from collections.abc import Sequence

__all__ = ["roscpp_initialize", "roscpp_shutdown"]


def roscpp_initialize(args: Sequence[str]) -> None:
    """Accept the arguments of a program, for programs that call this first. rospy has seen them already."""


def roscpp_shutdown() -> None:
    """Return; there is no second node to shut down."""
