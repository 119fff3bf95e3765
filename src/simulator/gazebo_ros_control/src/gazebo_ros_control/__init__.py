# SPDX-License-Identifier: BSD-3-Clause
"""ros_control on simulated joints: ``hardware`` is ROS-free, ``plugin`` is the model plugin around it."""
