# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's force plugins: on a joint, on a link, and a constant push."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped

from bullet_sim import BulletSimError
from gazebo_plugins.joint_wrench import JointWrench, contact_forces
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.sensor_plugins import PacedSensor
from gazebo_ros.urdf_extras import unscoped
from urdf_model import OutOfBounds, bounds

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext


class ForceTorqueSensor(PacedSensor):
    """``libgazebo_ros_ft_sensor.so``: publishes the wrench through the joint ``jointName``, by default the one whose
    ``<sensor>`` it is in, movable or fixed, on
    ``topicName``, in the axes of the child link and about the joint: the wrench of the child on the parent."""

    message_class = WrenchStamped

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        name = unscoped(context.model.name, context.element_text("jointName", self.link or ""))
        try:
            self._joint = JointWrench(context.world, context.model, name)
        except BulletSimError as error:
            raise PluginError("%s: <jointName>: %s" % (self.what, error)) from error
        self._frame = context.frame(self._joint.child)
        self._noise = self.noise()
        self._measuring = False

    def update(self, time_s: float, dt: float) -> None:
        if self.publisher.has_listeners and self._pace.is_due(time_s + dt):
            self._joint.note()
            self._measuring = True

    def publish(self, time_s: float) -> None:
        if not self._measuring:
            return
        self._measuring = False
        self._pace.took(time_s)
        force, torque = self._joint.measure()
        if self._noise:
            random = self.context.world.random
            force, torque = force + random.normal(0.0, self._noise, 3), torque + random.normal(0.0, self._noise, 3)
        self.publisher.publish(self.stamped(WrenchStamped(wrench=_wrench(force, torque)), time_s, self._frame))

    def reset(self) -> None:
        super().reset()
        self._measuring = False


class LinkForce(PacedSensor):
    """``libgazebo_ros_f3d.so``: publishes the wrench of contacts and applied forces on the link ``bodyName``, in world
    axes, about its origin; without weight."""

    message_class = WrenchStamped

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._link = self.link_named("bodyName")
        self._body = context.model.merged.frames[self._link].link
        self._frame = context.frame(context.element_text("frameName", "world"))

    def publish(self, time_s: float) -> None:
        if not self.is_due(time_s):
            return
        model = self.context.model
        origin = np.asarray(model.link_pose(self._link).position)
        force, torque = np.zeros(3), np.zeros(3)
        for body, push, turn, where in model.pushes():
            if body == self._body:
                arm = np.zeros(3) if where is None else where - origin
                force, torque = force + push, torque + turn + np.cross(arm, push)
        for _, push, where in contact_forces(self.context.world, model, (self._body,)):
            force, torque = force + push, torque + np.cross(where - origin, push)
        self.publisher.publish(self.stamped(WrenchStamped(wrench=_wrench(force, torque)), time_s, self._frame))


class Force(ModelPlugin):
    """``libgazebo_ros_force.so``: pushes the link ``bodyName`` with the last geometry_msgs/Wrench of ``topicName``, in
    world axes, until the next one."""

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        name = context.element_text("bodyName", "")
        self._link = unscoped(context.model.name, name)
        topic = context.element_text("topicName")
        if self._link not in context.model.link_names:
            raise PluginError("%s: <bodyName> is '%s', expected one of the links %s"
                              % (what, name, ", ".join(context.model.link_names)))
        if topic is None:
            raise PluginError("%s names no topic; expected <topicName>" % what)
        self._what = what
        self._push = None
        self._commands = context.subscription(topic, Wrench)

    def update(self, time_s: float, dt: float) -> None:
        self._commands.handle(self._take)
        if self._push is not None:
            self.context.model.apply_wrench(self._link, *self._push)

    def _take(self, message: Wrench) -> None:
        push = tuple((part.x, part.y, part.z) for part in (message.force, message.torque))
        try:
            bounds.FORCE.check(push[0], "the force")
            bounds.TORQUE.check(push[1], "the torque")
        except OutOfBounds as error:
            self.context.log.warn_throttle(5.0, "%s: %s; the message is ignored" % (self._what, error))
            return
        self._push = push if any(map(any, push)) else None

    def reset(self) -> None:
        self._push = None
        self._commands.take()


def _wrench(force: np.ndarray, torque: np.ndarray) -> Wrench:
    return Wrench(Vector3(*force), Vector3(*torque))

