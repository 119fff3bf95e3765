# SPDX-License-Identifier: BSD-3-Clause
"""Fits the actuators' numbers of profile:=robot to the motion of a robot's arms."""
