# SPDX-License-Identifier: BSD-3-Clause
"""A lift with a door that goes to floors, and velocities that a model starts with."""
from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from std_msgs.msg import String

from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.urdf_extras import unscoped
from urdf_model import OutOfBounds, bounds

if TYPE_CHECKING:
    from collections.abc import Callable

    from gazebo_ros.model_plugin import PluginContext

# A joint goes to its target with these speeds for each metre that it is away [1/s], and with these largest forces [N]:
# the proportional by the derivative gain of Gazebo's elevator plugin, and the former for one metre.
_DOOR_RATE, _DOOR_FORCE = 2.0, 2.0
_LIFT_RATE, _LIFT_FORCE = 1.0, 1e5
# A joint that is nearer than this to its target [m] has arrived.
_DOOR_NEAR, _LIFT_NEAR = 0.05, 0.15
_OPEN_M = 1.0  # of the door
_MAX_FLOOR = 1000


class Elevator(ModelPlugin):
    """``libgazebo_ros_elevator.so``. Elements: ``lift_joint`` and ``door_joint``, prismatic joints; ``floor_height``
    (3 m); ``door_wait_time`` (5 s); ``topic`` (``elevator``): std_msgs/String with the number of a floor.

    A command closes the door, moves the lift, opens the door for the waiting time and closes it. Commands that come
    meanwhile are ignored, as by Gazebo's. The joints' motors take what load there is, up to the forces of Gazebo's
    gains for a metre.
    """

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        self._joints = context.model.index([self._joint(tag) for tag in ("door_joint", "lift_joint")])
        self._height = self._number("floor_height", 3.0)
        self._wait_s = self._number("door_wait_time", 5.0)
        self._targets = np.zeros(2)  # of door and lift [m]
        # Functions of the time that tell whether the next one may come.
        self._states: deque[Callable[[float], bool]] = deque()
        self._until_s: float | None = None
        self._commands = context.subscription(context.element_text("topic", "elevator"), String)

    def _joint(self, tag: str) -> str:
        name = unscoped(self.context.model.name, self.context.element_text(tag, ""))
        sliding = [joint.name for joint in self.context.robot.movable_joints() if joint.type == "prismatic"]
        if name not in sliding:
            raise PluginError("%s: <%s> is '%s', expected one of the prismatic joints %s"
                              % (self._what, tag, name, ", ".join(sliding) or "(there are none)"))
        return name

    def _number(self, tag: str, default: float) -> float:
        text = self.context.element_text(tag, str(default))
        try:
            return bounds.POSITION.check(float(text), "<%s>" % tag)
        except ValueError as error:
            raise PluginError("%s: <%s> is '%s', expected a number" % (self._what, tag, text)) from error

    def update(self, time_s: float, dt: float) -> None:
        self._commands.handle(self._take)
        while self._states and self._states[0](time_s):
            self._states.popleft()
        error = self._targets - self.context.model.read_joints()[0][self._joints]
        self.context.model.drive_velocity(self._joints, np.array([_DOOR_RATE, _LIFT_RATE]) * error,
                                          np.array([_DOOR_FORCE, _LIFT_FORCE]))

    def _take(self, message: String) -> None:
        try:
            floor = int(message.data)
        except ValueError:
            floor = None
        if floor is None or abs(floor) > _MAX_FLOOR:
            self.context.log.warn_throttle(1.0, "%s: '%s' was commanded, expected the number of a floor, at most %d"
                                           % (self._what, message.data, _MAX_FLOOR))
        elif not self._states:
            self._states += [partial(self._moves, 0, 0.0, _DOOR_NEAR),
                             partial(self._moves, 1, floor * self._height, _LIFT_NEAR),
                             partial(self._moves, 0, _OPEN_M, _DOOR_NEAR), self._waits,
                             partial(self._moves, 0, 0.0, _DOOR_NEAR)]

    def _moves(self, joint: int, target: float, near: float, time_s: float) -> bool:
        self._targets[joint] = target
        return abs(target - self.context.model.read_joints()[0][self._joints[joint]]) < near

    def _waits(self, time_s: float) -> bool:
        if self._until_s is None:
            self._until_s = time_s + self._wait_s
        if time_s < self._until_s:
            return False
        self._until_s = None
        return True

    def reset(self) -> None:
        self._states.clear()
        self._until_s = None
        self._targets[:] = 0.0


class InitialVelocity(ModelPlugin):
    """``libInitialVelocityPlugin.so``: the model starts, and starts again after a reset, with the velocities ``linear``
    [m/s] and ``angular`` [rad/s], in world axes; of a model in a model, its own links."""

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._twist = [self._vector(tag, bound) for tag, bound in (
            ("linear", bounds.SPEED), ("angular", bounds.TURN_RATE))]
        self._start()

    def _vector(self, tag: str, bound: bounds.Bound) -> list[float]:
        text = self.context.element_text(tag, "0 0 0")
        try:
            values = bound.check([float(word) for word in text.split()], "<%s>" % tag)
        except (ValueError, OutOfBounds) as error:
            raise PluginError("plugin %s of model '%s': %s" % (
                self.context.element.get("filename"), self.context.model.name, error)) from error
        if len(values) != 3:
            raise PluginError("plugin %s of model '%s': <%s> is '%s', expected three numbers" % (
                self.context.element.get("filename"), self.context.model.name, tag, text))
        return values

    def _start(self) -> None:
        model, scope = self.context.model, self.context.element.getparent().get("scope", "")
        if not scope:
            model.set_base_twist(*self._twist)
            return
        for root in model.merged.roots[1 if model.static else 0:]:
            if root.startswith(scope):
                model.set_root_twist(root, *self._twist)

    def reset(self) -> None:
        self._start()
