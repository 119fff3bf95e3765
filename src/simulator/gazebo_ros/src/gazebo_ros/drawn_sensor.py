# SPDX-License-Identifier: BSD-3-Clause
"""Sensors whose measurements are pictures."""
from __future__ import annotations

from typing import TYPE_CHECKING

from gazebo_ros.model_plugin import ModelPlugin

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext


class DrawnSensor(ModelPlugin):
    """A camera or depth camera. The loop does nothing for it: /sensor_renderer finds it in the scene and serves it."""

    required = False
    named_if_empty = True


class Prosilica(DrawnSensor):
    """``libgazebo_ros_prosilica.so``: a camera that streams. Of one whose parameter ``trigger_mode`` is ``polled`` a
    warning says so: polled_camera is in no package of Debian's ROS."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        mode = context.param("trigger_mode", "streaming")
        if mode != "streaming":
            context.log.warn("plugin %s of model '%s': trigger_mode is '%s', and it streams all the same: its service "
                             "for single pictures is of polled_camera, which is not there"
                             % (context.element.get("filename"), context.model.name, mode))
