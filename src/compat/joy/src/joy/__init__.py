# SPDX-License-Identifier: BSD-3-Clause
"""Joysticks of Linux, without ROS: the kernel's events, and when a message about them is due."""
from .device import JoystickDevice, JoystickLost
from .outgoing import Outgoing
from .readings import Readings

__all__ = ["JoystickDevice", "JoystickLost", "Outgoing", "Readings"]
