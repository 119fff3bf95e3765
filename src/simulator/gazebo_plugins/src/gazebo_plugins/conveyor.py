# SPDX-License-Identifier: BSD-3-Clause
"""A conveyor: a belt whose surface moves and carries by friction what lies on it."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from std_msgs.msg import Float64

from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.urdf_extras import unscoped

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

#: Fastest belt [m/s].
MAX_M_S = 2.0


class ConveyorBelt(ModelPlugin):
    """``libconveyor_belt.so``. Elements: ``joint``, a prismatic joint between the frame and the belt, along which the
    belt carries; ``speed`` (0.1 m/s); ``commandTopic`` (``conveyor/command``, std_msgs/Float64: another speed, below
    zero backwards).

    In each step the belt moves by speed times step, and it is put back before the next one: it has the speed of its
    surface, and friction does the rest.
    """

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        name = unscoped(context.model.name, context.element_text("joint", ""))
        belts = [joint.name for joint in context.robot.movable_joints() if joint.type == "prismatic"]
        if name not in belts:
            raise PluginError("%s: <joint> is '%s', expected one of the prismatic joints %s"
                              % (self._what, name, ", ".join(belts) or "(there are none)"))
        self._joint = context.model.index([name])
        text = context.element_text("speed", "0.1")
        speed = self._checked(text)
        if speed is None:
            raise PluginError("%s: <speed> is '%s', expected -%g to %g m/s" % (self._what, text, MAX_M_S, MAX_M_S))
        self._speed = speed
        self._commands = context.subscription(context.element_text("commandTopic", "conveyor/command"), Float64)

    def update(self, time_s: float, dt: float) -> None:
        self._commands.handle(self._take)
        self.context.model.carry(self._joint, np.zeros(1), np.array([self._speed]))

    def _take(self, message: Float64) -> None:
        speed = self._checked(message.data)
        if speed is None:
            self.context.log.warn_throttle(1.0, "%s: a speed of %s was commanded, expected -%g to %g m/s"
                                           % (self._what, message.data, MAX_M_S, MAX_M_S))
        else:
            self._speed = speed

    @staticmethod
    def _checked(value: float | str) -> float | None:
        """The speed [m/s], or None where it is out of range."""
        try:
            speed = float(value)
        except ValueError:
            return None
        return speed if math.isfinite(speed) and abs(speed) <= MAX_M_S else None
