# SPDX-License-Identifier: BSD-3-Clause
"""Policies on robots of a ROS master. The rest of the package is free of ROS."""
