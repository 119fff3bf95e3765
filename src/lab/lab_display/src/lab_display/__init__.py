# SPDX-License-Identifier: BSD-3-Clause
"""Pictures for notebooks and terminals. `show` gets the data from ROS; the other modules need no ROS."""
