# SPDX-License-Identifier: BSD-3-Clause
"""What can be wrong with a robot, or with a question about it."""
from motion_planning.errors import PlanningError


class ModelError(PlanningError):
    """URDF and SRDF make no robot that can be planned for, or a name or value does not fit it."""
