# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of ROS messages over time.

Modules fields and recording know neither ROS nor Qt; subscriptions is ROS; graph and window are Qt.
"""
