# SPDX-License-Identifier: BSD-3-Clause
"""Small building blocks that programs for the robot share: waiting on a condition, and signals."""
from .signals import Signal
from .wait_for import wait_for
from .weakrefset import WeakRefSet

__all__ = ["Signal", "WeakRefSet", "wait_for"]
