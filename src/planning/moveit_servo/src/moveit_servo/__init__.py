# SPDX-License-Identifier: BSD-3-Clause
"""Steers an arm by twists, joint velocities or poses. ``Servo`` is free of ROS; ``node`` serves it under MoveIt Servo's
names.
"""
