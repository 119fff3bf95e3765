# SPDX-License-Identifier: BSD-3-Clause
"""What the examples for the robot share."""
from .joint_recorder import JointRecorder

__all__ = ["JointRecorder"]
