# SPDX-License-Identifier: BSD-3-Clause
"""Plugins of Gazebo that are accepted and have no effect here."""
from __future__ import annotations

from typing import TYPE_CHECKING

from std_msgs.msg import Int32, String

from gazebo_ros.model_plugin import ModelPlugin

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext


class Nothing(ModelPlugin):
    """A plugin that does nothing in Gazebo, or whose function the simulator has built in:
    ``libgazebo_ros_template.so``, ``libgazebo_ros_api_plugin.so``, ``libgazebo_ros_paths_plugin.so``; and
    ``libroboticsgroup_gazebo_disable_link_plugin.so``, whose link ODE enables again in the next step."""

    required = False


class Projector(ModelPlugin):
    """``libgazebo_ros_projector.so``: its topics exist (``projectorTopicName``, std_msgs/Int32, and
    ``textureTopicName``, std_msgs/String), but no light is thrown: cameras see the world without its pattern."""

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        context.log.warn("plugin %s of model '%s': projected patterns are not drawn; its topics are there and have no "
                         "effect" % (context.element.get("filename"), context.model.name))
        self._subscriptions = [context.subscription(topic, kind) for topic, kind in (
            (context.element_text("projectorTopicName"), Int32), (context.element_text("textureTopicName"), String))
            if topic is not None]

    def update(self, time_s: float, dt: float) -> None:
        for subscription in self._subscriptions:
            subscription.take()
