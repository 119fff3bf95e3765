# SPDX-License-Identifier: BSD-3-Clause
"""Processes of Linux, and what belongs to them. Free of ROS."""
