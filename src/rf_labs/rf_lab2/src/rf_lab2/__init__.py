# SPDX-License-Identifier: BSD-3-Clause
"""Lab 2 of Robotics Foundations: the parts that its nodes share."""
