# SPDX-License-Identifier: BSD-3-Clause
"""Motions of industrial robots: point to point, lines, arcs, and sequences of them with rounded corners."""
from motion_planning.industrial.commands import PLANNERS, Auxiliary, Command, plan
from motion_planning.industrial.limits import CartesianLimits
from motion_planning.industrial.sequence import plan_sequence

__all__ = ["PLANNERS", "Auxiliary", "CartesianLimits", "Command", "plan", "plan_sequence"]
