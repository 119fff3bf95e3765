# SPDX-License-Identifier: BSD-3-Clause
"""Set-points as the messages of a controller: trajectories of one point, arrays, or the commands of Baxter's limbs."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import roslib.message
import rospy
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from moveit_servo.settings import ARRAY, BAXTER, TRAJECTORY, SettingsError

if TYPE_CHECKING:
    from moveit_servo.servo import ServoStep
    from moveit_servo.settings import ServoSettings

# Points of a trajectory for Gazebo, whose controller may drop those that are late.
_POINTS_FOR_GAZEBO = 30
# How much longer than its step a period of a controller is, from rest until points are due a command_lead later: so
# that the arm begins to move at once.
_SLOWER_FIRST = 0.25
# Velocities without positions drift; this share of the distance to the set-point is added to them [1/s].
_RETURN_RATE = 2.0


def message_type(name: str) -> type:
    """Return the class of a settings' ``command_out_type``. Raises SettingsError where its package is missing."""
    # Baxter's by its name: a robot without it needs no package of Baxter.
    kind = roslib.message.get_message_class(name)
    if kind is None:
        raise SettingsError("command_out_type is %s, and the package %s is not there" % (name, name.partition("/")[0]))
    return kind


def message_of(step: ServoStep, measured: np.ndarray, joints: tuple[str, ...], settings: ServoSettings,
               seconds: float = 0.0, now: float = 0.0) -> Any:
    """Return the message of ``settings.command_out_type`` for a ServoStep; measured (k,): where the joints are;
    seconds: how long the step is; now: when it was made. A trajectory takes that time, or a period: a step that came
    late is a long one, and its way in one period would be faster than the servo allows. With a command_lead it is due
    at a time: otherwise one that comes late, or together with the next, is hurried by what it is late.
    """
    lead, pace = _lead(step, settings)
    positions, accelerations = step.position.tolist(), (pace**2 * step.acceleration).tolist()
    velocities = pace * step.velocity
    if not settings.publish_joint_positions and not step.rests:
        velocities = velocities + _RETURN_RATE * (step.position - measured)
    velocities = velocities.tolist()
    if settings.command_out_type == ARRAY:
        return Float64MultiArray(data=positions if settings.publish_joint_positions else
                                 velocities if settings.publish_joint_velocities else [])
    if settings.command_out_type == BAXTER:
        by_position = settings.publish_joint_positions
        kind = message_type(BAXTER)
        return kind(mode=kind.RAW_POSITION_MODE if by_position else kind.VELOCITY_MODE, names=list(joints),
                    command=positions if by_position else velocities)
    trajectory = JointTrajectory(joint_names=list(joints))
    trajectory.header.frame_id = settings.planning_frame
    if settings.command_lead > 0.0:
        trajectory.header.stamp, first = rospy.Time.from_sec(now), lead
    else:
        first = max(seconds, settings.publish_period)  # from when it comes: the stamp is 0
    for number in range(_POINTS_FOR_GAZEBO if settings.use_gazebo else 1):
        trajectory.points.append(JointTrajectoryPoint(
            positions=positions if settings.publish_joint_positions else [],
            velocities=velocities if settings.publish_joint_velocities else [],
            accelerations=accelerations if settings.publish_joint_accelerations else [],
            time_from_start=rospy.Duration.from_sec(first + number * settings.publish_period)))
    return trajectory


def _lead(step: ServoStep, settings: ServoSettings) -> tuple[float, float]:
    """How long after its step a trajectory's point is due [s], and the pace at which the controller then follows."""
    grown = settings.publish_period + _SLOWER_FIRST * step.moving
    if settings.command_out_type != TRAJECTORY or grown >= settings.command_lead:
        return settings.command_lead, 1.0
    return grown, 1.0 / (1.0 + _SLOWER_FIRST)
