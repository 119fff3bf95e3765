# SPDX-License-Identifier: BSD-3-Clause
"""The grippers: the commands of each kind, and the bodies that they move in the simulated world. Without ROS."""
