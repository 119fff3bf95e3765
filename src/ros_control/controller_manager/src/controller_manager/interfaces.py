# SPDX-License-Identifier: BSD-3-Clause
"""Names of the hardware interfaces, as in ``controller_manager_msgs/ControllerState``."""

JOINT_STATE = "hardware_interface::JointStateInterface"
POSITION = "hardware_interface::PositionJointInterface"
VELOCITY = "hardware_interface::VelocityJointInterface"
EFFORT = "hardware_interface::EffortJointInterface"
#: Positions with their velocities, and accelerations: here a command is the position.
POS_VEL = "hardware_interface::PosVelJointInterface"
POS_VEL_ACC = "hardware_interface::PosVelAccJointInterface"

#: Interfaces whose commands are positions.
POSITIONS = (POSITION, POS_VEL, POS_VEL_ACC)
#: Interfaces that command a joint: a controller that uses a joint through one of these claims it.
COMMAND = (*POSITIONS, VELOCITY, EFFORT)

#: Interfaces that are only read; for sensors, see ``RobotHardware.sensors``.
IMU_SENSOR = "hardware_interface::ImuSensorInterface"
FORCE_TORQUE_SENSOR = "hardware_interface::ForceTorqueSensorInterface"
