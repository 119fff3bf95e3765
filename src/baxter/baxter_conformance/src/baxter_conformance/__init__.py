# SPDX-License-Identifier: BSD-3-Clause
"""Compares what a ROS master shows with the interface of a physical Baxter. `comparison` and `contents` know no ROS."""
