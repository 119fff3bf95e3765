# SPDX-License-Identifier: BSD-3-Clause
"""Sensors whose measurements are pictures."""
from gazebo_ros.model_plugin import ModelPlugin


class DrawnSensor(ModelPlugin):
    """A camera or depth camera. The loop does nothing for it: /sensor_renderer finds it in the scene and serves it."""

    required = False
    named_if_empty = True
