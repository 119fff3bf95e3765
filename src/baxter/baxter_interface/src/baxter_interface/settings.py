# SPDX-License-Identifier: BSD-3-Clause
"""Constants of the SDK that programs import by name."""

# A joint has arrived when its error is less than half a degree [rad].
JOINT_ANGLE_TOLERANCE = 0.008726646
# The same for the head, which is less accurate: eight degrees [rad].
HEAD_PAN_ANGLE_TOLERANCE = 0.1396263401

SDK_VERSION = "1.2.0"
# Programs pass it as RobotEnable(versioned=...): compare the robot's software with this SDK.
CHECK_VERSION = True
# Robot software that each SDK works with, by its first three numbers.
VERSIONS_SDK2ROBOT = {"1.2.0": ["1.2.0"]}
# Gripper firmware that each SDK works with, by its date: older than `warn` is reported, `fail` or older is refused.
VERSIONS_SDK2GRIPPER = {"1.2.0": {"warn": "2014/5/20 00:00:00", "fail": "2013/10/15 00:00:00"}}
