# SPDX-License-Identifier: BSD-3-Clause
"""Motion planning for arms described by URDF and SRDF. Free of ROS; the sub-packages are the interface."""
