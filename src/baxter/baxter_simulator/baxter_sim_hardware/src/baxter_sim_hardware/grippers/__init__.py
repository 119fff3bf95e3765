# SPDX-License-Identifier: BSD-3-Clause
"""The grippers: what each kind does with a command, and the bodies it moves in the simulated world. Without ROS."""
