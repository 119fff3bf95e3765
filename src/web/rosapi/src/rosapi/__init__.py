# SPDX-License-Identifier: BSD-3-Clause
"""Questions about the ROS graph as services."""
