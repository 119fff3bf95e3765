# SPDX-License-Identifier: BSD-3-Clause
"""Exact collision checks of the original shapes by FCL; compiled code first excludes shapes that are far apart."""
from motion_planning.exact.checker import Contact, ExactChecker, Nearest

__all__ = ["Contact", "ExactChecker", "Nearest"]
