# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's inverse kinematics service and the commands on arm_kinematics. Free of ROS but for messages."""
