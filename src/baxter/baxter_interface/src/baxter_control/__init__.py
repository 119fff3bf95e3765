# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that programs for the robot share."""
from .pid import PID

__all__ = ["PID"]
