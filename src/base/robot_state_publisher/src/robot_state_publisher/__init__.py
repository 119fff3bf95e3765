# SPDX-License-Identifier: BSD-3-Clause
"""The frames of a robot's links on tf, from the positions of its joints. ROS-free."""

from .frames import Due, JointFrames

__all__ = ["Due", "JointFrames"]
