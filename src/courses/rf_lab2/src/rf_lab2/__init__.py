# SPDX-License-Identifier: BSD-3-Clause
"""Lab 2 of Robotics Foundations: shared modules of its nodes."""
