# SPDX-License-Identifier: BSD-3-Clause
"""A link that follows a frame of tf, and the true pose of a link as odometry."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from bullet_sim import BulletSimError
from gazebo_ros.convert import msg_from_pose, msg_from_twist
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.sensor_plugins import PacedSensor
from gazebo_ros.transforms import TransformSource, transform_msg
from gazebo_ros.urdf_extras import unscoped
from sim_time.pace import Pace
from urdf_model.transforms import quaternion_from_matrix

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

_WORLD = "world"
# Of the frame of where the link is [Hz]; Gazebo sends it at each step.
_FRAME_HZ = 100.0
# The part of inertia / step^2 that the stiffness of a spring may be.
_STABLE = 0.25


class HandOfGod(ModelPlugin):
    """``libgazebo_ros_hand_of_god.so``: pulls the link ``linkName``, which loses its weight, to the frame ``frameId``
    (hog) + ``_desired`` of tf in ``world``, and sends ``frameId`` + ``_actual``.

    ``kl`` (200 N/m) and ``ka`` (200 Nm for half a radian): critically damped springs on place and turn, as Gazebo's.
    """

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        name = context.element_text("linkName", "")
        self._link = unscoped(context.model.name, name)
        frames = context.model.merged.frames
        if self._link not in frames:
            raise PluginError("%s: <linkName> is '%s', expected one of the links %s"
                              % (self._what, name, ", ".join(frames)))
        self._body = frames[self._link].link
        self._frame = context.element_text("frameId", "hog")
        self._asked = self._number("kl", 200.0), self._number("ka", 200.0)
        self.step_changed(context.world.time_step_s)
        self._frames = TransformSource(context)
        self._sent = context.publisher("/tf", TFMessage)
        self._pace = Pace(_FRAME_HZ)
        self._waits = False
        context.model.set_weight(self._body, False)

    def _number(self, tag: str, default: float) -> float:
        text = self.context.element_text(tag, str(default))
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not 0.0 <= value < math.inf:
            raise PluginError("%s: <%s> is '%s', expected a number, 0 or more" % (self._what, tag, text))
        return value

    def step_changed(self, step_s: float) -> None:
        inertial = self.context.model.inertial(self._body)
        moments = np.linalg.eigvalsh(inertial.inertia)
        self._springs = (self._spring("kl", self._asked[0], inertial.mass, inertial.mass, step_s),
                         self._spring("ka", self._asked[1], inertial.inertia[0, 0], moments[0], step_s))

    def _spring(self, tag: str, asked: float, inertia: float, least: float, step_s: float) -> tuple[float, float]:
        """(stiffness, damping) of the spring ``tag``, whose stiffness is ``asked`` where that is stable."""
        # So damped, the spring is stable up to 0.68 of the least inertia / step^2.
        stiffness = min(asked, _STABLE * least / step_s ** 2)
        if stiffness < asked:
            self.context.log.warn("%s: <%s> of %g is unstable on an inertia of %g at steps of %g s; %.4g is used"
                                  % (self._what, tag, asked, least, step_s, stiffness))
        return stiffness, 2.0 * math.sqrt(stiffness * inertia)

    def update(self, time_s: float, dt: float) -> None:
        self._frames.take()
        wanted = self._frames.look_up(_WORLD, self._frame + "_desired")
        if wanted is None:
            if not self._waits:
                self.context.log.warn("%s waits for the frame %s_desired, which tf does not know in %s"
                                      % (self._what, self._frame, _WORLD))
            self._waits = True
            return
        self._waits = False
        model = self.context.model
        pose = model.link_pose(self._link).matrix()
        linear, angular = (np.asarray(part) for part in model.link_twist(self._link))
        axes = pose[:3, :3]
        (stiff, damping), (turn_stiff, turn_damping) = self._springs
        turn = axes @ _half_turn(axes.T @ wanted[:3, :3])
        try:
            model.apply_wrench(self._link, stiff * (wanted[:3, 3] - pose[:3, 3]) - damping * linear,
                               turn_stiff * turn - turn_damping * angular)
        except BulletSimError as error:  # as for a frame that is very far away
            self.context.log.warn_throttle(5.0, "%s: %s; it is not pulled" % (self._what, error))

    def publish(self, time_s: float) -> None:
        if not self._waits and self._sent.has_listeners and self._pace.take(time_s):
            pose = self.context.model.link_pose(self._link).matrix()
            self._sent.publish(TFMessage([transform_msg(time_s, _WORLD, self._frame + "_actual", pose)]))

    def reset(self) -> None:
        self._pace.restart()


class WorldOdometry(PacedSensor):
    """``libgazebo_world_odometry.so`` (PAL): the pose of the link ``frameName`` in the world, its speed in the world's
    axes and its turn rate in its own, on ``topicName``; 1000 Hz without ``updateRate``."""

    message_class = Odometry

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._link = self.link_named("frameName")
        self._frame = context.element_text("frameName", self._link)
        if self._pace.rate == 0.0:
            self._pace.rate = 1000.0

    def publish(self, time_s: float) -> None:
        if not self.is_due(time_s):
            return
        pose = self.context.model.link_pose(self._link)
        linear, angular = (np.asarray(part) for part in self.context.model.link_twist(self._link))
        message = Odometry(child_frame_id=self._link)
        message.pose.pose = msg_from_pose(pose)
        message.twist.twist = msg_from_twist(linear, pose.matrix()[:3, :3].T @ angular)
        self.publisher.publish(self.stamped(message, time_s, self._frame))


def _half_turn(rotation: np.ndarray) -> np.ndarray:
    """Axis times half the angle (3,) [rad] of a rotation (3, 3), as Gazebo's springs have it."""
    found = np.asarray(quaternion_from_matrix(rotation))
    vector, real = (found[:3], found[3]) if found[3] >= 0.0 else (-found[:3], -found[3])
    sine = np.linalg.norm(vector)
    return vector if sine < 1e-9 else vector / sine * math.atan2(sine, real)
