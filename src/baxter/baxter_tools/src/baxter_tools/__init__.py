# SPDX-License-Identifier: BSD-3-Clause
"""What the command-line tools for the robot are made of."""
