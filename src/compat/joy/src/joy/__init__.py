# SPDX-License-Identifier: BSD-3-Clause
"""Joysticks of Linux, without ROS: the kernel's events, and when a message about them is due."""
from .device import Device, DeviceLost
from .outgoing import Outgoing
from .readings import Readings

__all__ = ["Device", "DeviceLost", "Outgoing", "Readings"]
