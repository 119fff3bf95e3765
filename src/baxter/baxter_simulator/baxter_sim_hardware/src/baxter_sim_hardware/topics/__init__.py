# SPDX-License-Identifier: BSD-3-Clause
"""The robot's ROS interface: the table of topics, and for each part the conversion between messages and its core."""
