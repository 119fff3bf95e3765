# SPDX-License-Identifier: BSD-3-Clause
"""Constraints of goals and paths: evaluation, with a sentence for each violated one, and sampling."""
from motion_planning.constraints.sampling import Sampler, sampler
from motion_planning.constraints.sets import ConstraintSet
from motion_planning.constraints.targets import (
    ConstraintError,
    Evaluation,
    JointTarget,
    OrientationTarget,
    PositionTarget,
    VisibilityTarget,
    holder,
)

__all__ = ["ConstraintError", "ConstraintSet", "Evaluation", "JointTarget", "OrientationTarget", "PositionTarget",
           "Sampler", "VisibilityTarget", "holder", "sampler"]
