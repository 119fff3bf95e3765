# SPDX-License-Identifier: BSD-3-Clause
"""What a goal or a path must keep to: evaluated with a sentence where it is not kept, and sampled."""
from motion_planning.constraints.sampling import Sampler, sampler
from motion_planning.constraints.sets import ConstraintSet
from motion_planning.constraints.targets import (
    ConstraintError,
    Evaluation,
    JointTarget,
    OrientationTarget,
    PositionTarget,
    VisibilityTarget,
)

__all__ = ["ConstraintError", "ConstraintSet", "Evaluation", "JointTarget", "OrientationTarget", "PositionTarget",
           "Sampler", "VisibilityTarget", "sampler"]
