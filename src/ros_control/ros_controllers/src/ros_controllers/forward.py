# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that pass a command on to the joints unchanged."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from std_msgs.msg import Float64, Float64MultiArray

from controller_manager import EFFORT, POSITION, VELOCITY, Controller

if TYPE_CHECKING:
    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware


class ForwardController(Controller):
    """The newest command goes to the joints each tick, until a newer one comes. Base of the classes below.

    It starts from the present positions, or from velocity or effort 0. Commands that are not finite, and those of the
    wrong length, are reported and left out.
    """

    interface: str
    msg_class: type

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        self.joints = self._read_joints()
        self.index = self.claim(self.interface, self.joints)
        self._command = np.zeros(len(self.joints))
        self._subscription = context.subscription("command", self.msg_class)

    def _read_joints(self) -> list[str]:
        """The names of the joints, from the parameters."""
        raise NotImplementedError

    def starting(self, time_s: float) -> None:
        self._subscription.take()  # drop commands from before the start
        if self.interface == POSITION:
            self._command = self.hardware.position[self.index]
        else:
            self._command = np.zeros(len(self.joints))

    def update(self, time_s: float, dt: float) -> None:
        self._subscription.handle(self._accept)
        self.hardware.command[self.interface][self.index] = self._command

    def _accept(self, message):
        values = np.atleast_1d(np.array(message.data, dtype=float))
        if values.shape != self._command.shape:
            self.log.error_throttle(1.0, "%s: command of length %d ignored, expected a value for each of %s"
                                    % (self.context.resolve("command"), values.size, ", ".join(self.joints)))
        elif not np.isfinite(values).all():
            self.log.error_throttle(1.0, "%s: command %s ignored, expected finite numbers"
                                    % (self.context.resolve("command"), values.tolist()))
        else:
            self._command = values


class SingleForwardController(ForwardController):
    """For the joint in parameter ``joint``; std_msgs/Float64 on ``command``."""

    msg_class = Float64

    def _read_joints(self) -> list[str]:
        return [self.context.text("joint", "the name of a joint")]


class GroupForwardController(ForwardController):
    """For the joints in parameter ``joints``; std_msgs/Float64MultiArray on ``command``, one value per joint."""

    msg_class = Float64MultiArray

    def _read_joints(self) -> list[str]:
        return self.context.texts("joints", "a list of joint names")


class JointPositionController(SingleForwardController):
    """position_controllers/JointPositionController"""

    interface = POSITION


class JointVelocityController(SingleForwardController):
    """velocity_controllers/JointVelocityController"""

    interface = VELOCITY


class JointEffortController(SingleForwardController):
    """effort_controllers/JointEffortController"""

    interface = EFFORT


class JointGroupPositionController(GroupForwardController):
    """position_controllers/JointGroupPositionController"""

    interface = POSITION


class JointGroupVelocityController(GroupForwardController):
    """velocity_controllers/JointGroupVelocityController"""

    interface = VELOCITY


class JointGroupEffortController(GroupForwardController):
    """effort_controllers/JointGroupEffortController"""

    interface = EFFORT
