# SPDX-License-Identifier: BSD-3-Clause
"""The Foxglove WebSocket protocol: a core free of ROS."""
