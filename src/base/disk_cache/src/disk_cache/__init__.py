# SPDX-License-Identifier: BSD-3-Clause
"""Files that are made once and kept. Free of ROS."""
