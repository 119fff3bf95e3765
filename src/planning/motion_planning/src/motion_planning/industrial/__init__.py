# SPDX-License-Identifier: BSD-3-Clause
"""Motions of industrial robots: point to point, lines, arcs, and sequences of them with rounded corners."""
from motion_planning.industrial.commands import PLANNERS, Auxiliary, IndustrialCommand, plan
from motion_planning.industrial.limits import CartesianLimits
from motion_planning.industrial.sequence import plan_sequence

__all__ = ["PLANNERS", "Auxiliary", "CartesianLimits", "IndustrialCommand", "plan", "plan_sequence"]
