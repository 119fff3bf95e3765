# SPDX-License-Identifier: BSD-3-Clause
"""The arms: command modes and their set-points, collisions, the wrench on the tip, maintenance procedures. Without
ROS."""
