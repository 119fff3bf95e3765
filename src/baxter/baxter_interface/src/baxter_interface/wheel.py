# SPDX-License-Identifier: BSD-3-Clause
"""The wheel of a navigator: a counter of eight bits. Free of ROS."""

from __future__ import annotations

COUNTS = 256


def wheel_steps(before: int, after: int) -> int:
    """Signed steps between two readings (0 to 255) that are less than half a turn of the counter apart."""
    return (after - before + COUNTS // 2) % COUNTS - COUNTS // 2
