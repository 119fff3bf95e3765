# SPDX-License-Identifier: BSD-3-Clause
"""Errors of robot models and of queries about them."""
from motion_planning.errors import PlanningError


class ModelError(PlanningError):
    """URDF and SRDF do not make a valid model, or a name or value does not fit the model."""
