# SPDX-License-Identifier: BSD-3-Clause
"""The result of plan(): noetic's tuple, which melodic's programs can use as the trajectory that they expect."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from moveit_msgs.msg import RobotTrajectory

if TYPE_CHECKING:
    from trajectory_msgs.msg import JointTrajectory

    Motion = tuple | RobotTrajectory | JointTrajectory


class PlanTuple(tuple):
    """(success, RobotTrajectory, planning time [s], MoveItErrorCodes).

    Every attribute of the trajectory is one of the plan, too (``plan.joint_trajectory.points``, ``plan.serialize``), so
    that a plan can be executed, changed, put into a message or published where a program has taken it for a trajectory.
    """

    @property
    def trajectory(self) -> RobotTrajectory:
        return self[1]

    def __getattr__(self, name: str) -> Any:
        # Only names that a tuple does not have; Python's special names are looked up while a plan is copied.
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self[1], name)

    def __setattr__(self, name: str, value: object) -> None:
        setattr(self[1], name, value)


def trajectory_of(plan: Motion | None) -> RobotTrajectory:
    """Return the RobotTrajectory in a PlanTuple, a tuple like it, a RobotTrajectory or a JointTrajectory.

    Raises TypeError for anything else.
    """
    if isinstance(plan, tuple):
        found = [part for part in plan if isinstance(part, RobotTrajectory)]
        plan = found[0] if found else plan
    if getattr(plan, "_type", "") == "trajectory_msgs/JointTrajectory":  # also of a bag, which has another class
        return RobotTrajectory(joint_trajectory=cast("JointTrajectory", plan))
    if not isinstance(plan, RobotTrajectory):
        raise TypeError("expected a RobotTrajectory, a JointTrajectory or what plan() returns, got %s"
                        % type(plan).__name__)
    return plan
