# SPDX-License-Identifier: BSD-3-Clause
"""The simulator that a notebook works with: found, or started and ended with the notebook."""

from .labs import LABS
from .session import NoLab, RunningLab, connect

__all__ = ["LABS", "RunningLab", "NoLab", "connect"]
