# SPDX-License-Identifier: BSD-3-Clause
"""The modules of the command-line tools for the robot."""
