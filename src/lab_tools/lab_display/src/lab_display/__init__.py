# SPDX-License-Identifier: BSD-3-Clause
"""Pictures for notebooks and terminals. `show` asks ROS for what is to be shown; the other modules need no ROS."""
