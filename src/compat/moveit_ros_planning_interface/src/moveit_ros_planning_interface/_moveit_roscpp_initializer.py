# SPDX-License-Identifier: BSD-3-Clause
"""Start and end of a C++ node that is not there."""
from __future__ import annotations

from collections.abc import Sequence

from moveit_commander import roscpp_shutdown

__all__ = ["roscpp_init", "roscpp_shutdown"]


def roscpp_init(node_name: str = "", args: Sequence[str] = ()) -> None:
    """Accept a node's name and arguments; rospy has seen them already."""
