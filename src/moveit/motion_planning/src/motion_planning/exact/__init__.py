# SPDX-License-Identifier: BSD-3-Clause
"""Exact collision checks: every shape as it is, by FCL; what is far apart is sorted out by compiled code first."""
from motion_planning.exact.checker import Contact, ExactChecker, Nearest

__all__ = ["Contact", "ExactChecker", "Nearest"]
