# SPDX-License-Identifier: BSD-3-Clause
"""Devices that people steer arms with. ``steering`` is free of ROS; ``hands`` sends to servos and grippers."""
