# SPDX-License-Identifier: BSD-3-Clause
"""The ``/gazebo`` node: a PyBullet world behind the ROS interface of Gazebo classic."""
