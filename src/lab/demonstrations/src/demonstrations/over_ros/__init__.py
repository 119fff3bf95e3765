# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations on a ROS master, and out of its recordings."""
