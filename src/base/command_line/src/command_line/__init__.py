# SPDX-License-Identifier: BSD-3-Clause
"""Command lines: words, files and waits. Free of ROS."""
