# SPDX-License-Identifier: BSD-3-Clause
"""The arms: command modes and their set-points, collisions, what the tip feels, maintenance procedures. Without ROS."""
