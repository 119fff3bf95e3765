# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories of joints: made of points, sampled, replaced in flight, watched. Free of ROS; time is an argument."""
from .command import Command, joint_indices
from .errors import (
    AllPointsInPast,
    BeforeTrajectory,
    JointNamesError,
    MissingJoints,
    NoJointNames,
    NoPositions,
    NotFinite,
    RepeatedJoints,
    TimesNotIncreasing,
    TrajectoryError,
    UnknownJoints,
    WrongSize,
)
from .follower import Follower
from .goal_monitor import GoalMonitor, Outcome, Verdict
from .replacement import Replacement, replace
from .tolerances import Tolerances, bounds, merge_tolerances
from .trajectory import Trajectory, hold, stop

__all__ = [
    "AllPointsInPast",
    "BeforeTrajectory",
    "Command",
    "Follower",
    "GoalMonitor",
    "JointNamesError",
    "MissingJoints",
    "NoJointNames",
    "NoPositions",
    "NotFinite",
    "Outcome",
    "RepeatedJoints",
    "Replacement",
    "TimesNotIncreasing",
    "Tolerances",
    "Trajectory",
    "TrajectoryError",
    "UnknownJoints",
    "Verdict",
    "WrongSize",
    "bounds",
    "hold",
    "joint_indices",
    "merge_tolerances",
    "replace",
    "stop",
]
