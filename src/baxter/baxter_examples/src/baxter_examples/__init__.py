# SPDX-License-Identifier: BSD-3-Clause
"""Shared modules of the examples for the robot."""
from .joint_recorder import JointRecorder

__all__ = ["JointRecorder"]
