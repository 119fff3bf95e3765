# SPDX-License-Identifier: BSD-3-Clause
"""Joint trajectories: made from points, sampled, replaced during execution, monitored. Free of ROS; time is an
argument."""
from .action_edge import (
    ErrorCode,
    GoalTolerances,
    code_of_error,
    code_of_outcome,
    command_of,
    rows_of_points,
    tolerances_of,
)
from .command import TrajectoryCommand, joint_indices
from .errors import (
    AllPointsInPast,
    BeforeTrajectory,
    BeyondLimit,
    BeyondPosition,
    BeyondVelocity,
    JointNamesError,
    MissingJoints,
    NoJointNames,
    NoPoints,
    NoPositions,
    NotFinite,
    RepeatedJoints,
    TimesNotIncreasing,
    TrajectoryError,
    UnknownJoints,
    WrongSize,
)
from .follower import Follower
from .goal_monitor import GoalMonitor, GoalOutcome, GoalVerdict
from .limits import Limits
from .replacement import Replacement, replace
from .segment import smooth_velocities
from .tolerances import Tolerances, bounds, merge_tolerances
from .trajectory import Trajectory, hold, stop

__all__ = [
    "AllPointsInPast",
    "BeforeTrajectory",
    "BeyondLimit",
    "BeyondPosition",
    "BeyondVelocity",
    "TrajectoryCommand",
    "ErrorCode",
    "Follower",
    "GoalMonitor",
    "GoalTolerances",
    "JointNamesError",
    "Limits",
    "MissingJoints",
    "NoJointNames",
    "NoPoints",
    "NoPositions",
    "NotFinite",
    "GoalOutcome",
    "RepeatedJoints",
    "Replacement",
    "TimesNotIncreasing",
    "Tolerances",
    "Trajectory",
    "TrajectoryError",
    "UnknownJoints",
    "GoalVerdict",
    "WrongSize",
    "bounds",
    "code_of_error",
    "code_of_outcome",
    "command_of",
    "hold",
    "joint_indices",
    "merge_tolerances",
    "replace",
    "rows_of_points",
    "smooth_velocities",
    "stop",
    "tolerances_of",
]
