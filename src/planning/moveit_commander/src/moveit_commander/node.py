# SPDX-License-Identifier: BSD-3-Clause
"""The rospy node that a program's commanders share."""
from __future__ import annotations

import rospy


def ensure_node() -> None:
    """Start a node for a program that has none, as programs may that know commanders alone."""
    if not rospy.core.is_initialized():
        rospy.init_node("move_group_commander_wrappers", anonymous=True, disable_signals=True)
