# SPDX-License-Identifier: BSD-3-Clause
"""What the judge and its recorder in the simulator agree on. Free of ROS."""

SOCKET_VARIABLE = "LAB_JUDGE_SOCKET"
PLUGIN_ELEMENT = '<gazebo><plugin name="lab_recorder" filename="liblab_recorder.so"/></gazebo>'
