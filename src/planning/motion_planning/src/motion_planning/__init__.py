# SPDX-License-Identifier: BSD-3-Clause
"""Motion planning for arms described by URDF and SRDF. No ROS needed; the sub-packages are the interface."""
