# SPDX-License-Identifier: BSD-3-Clause
"""How rospy nodes start, end, and listen."""
