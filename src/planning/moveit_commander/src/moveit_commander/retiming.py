# SPDX-License-Identifier: BSD-3-Clause
"""New times for a trajectory that exists."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rospy
from moveit_msgs.msg import RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from .exception import MoveItCommanderException

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel


def retimed(model: PlanningModel, trajectory: RobotTrajectory, scaling: tuple[float, float],
            algorithm: str) -> RobotTrajectory:
    """Return a RobotTrajectory along the same points, as fast as limits allow; empty for an unknown ``algorithm``.

    scaling: shares of the limits of velocity and acceleration; one that is not above 0 and at most 1 counts as 1.
    Raises MoveItCommanderException for an unknown joint, and for points that are not a path.
    """
    # Compiled code, which few programs need.
    from motion_planning.timing import ALGORITHMS, TimingError, time_path

    if algorithm not in ALGORITHMS:
        rospy.logerr("retime_trajectory: there is no algorithm '%s'; expected one of %s",
                     algorithm, ", ".join(ALGORITHMS))
        return RobotTrajectory()
    old = trajectory.joint_trajectory
    unknown = [name for name in old.joint_names if name not in model.index]
    if unknown:
        raise MoveItCommanderException("the trajectory moves %s; the robot has no such joint" % ", ".join(unknown))
    indices = [model.index[name] for name in old.joint_names]
    result = RobotTrajectory(multi_dof_joint_trajectory=trajectory.multi_dof_joint_trajectory)
    result.joint_trajectory.header, result.joint_trajectory.joint_names = old.header, old.joint_names
    if not old.points:
        return result
    velocity, acceleration = (share if 0.0 < share <= 1.0 else 1.0 for share in scaling)
    try:
        timed = time_path(np.array([point.positions for point in old.points]), velocity * model.velocity[indices],
                          acceleration * model.acceleration[indices], algorithm)
    except TimingError as error:
        raise MoveItCommanderException("the trajectory cannot be timed: %s" % error) from None
    rows = zip(timed.times, timed.positions, timed.velocities, timed.accelerations, strict=True)
    result.joint_trajectory.points = [
        JointTrajectoryPoint(positions=positions.tolist(), velocities=velocities.tolist(),
                             accelerations=accelerations.tolist(), time_from_start=rospy.Duration.from_sec(time))
        for time, positions, velocities, accelerations in rows]
    return result
