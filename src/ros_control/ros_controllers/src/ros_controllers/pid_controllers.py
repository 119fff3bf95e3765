# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that hold a position or a velocity with a PID whose output is an effort or a velocity."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from control_msgs.msg import JointControllerState
from std_msgs.msg import Float64, Float64MultiArray

from controller_manager import EFFORT, VELOCITY, Controller, ControllerError, Gains, Pid
from controller_manager.pid_tuning import TunablePids
from sim_time.stamps import stamp

if TYPE_CHECKING:
    import numpy.typing as npt

    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware

# A state message goes out with every tenth update.
STATE_EVERY = 10


class PidController(Controller):
    """Base of the classes below: k joints, each with a PID from the error to a command of ``interface``.

    The command topic carries one value per joint; invalid values or lengths are logged and ignored.
    The gains can be tuned at run time (:mod:`controller_manager.pid_tuning`).
    Subclasses define the error from command and state, and the command at the start.
    """

    interface = EFFORT
    msg_class: type

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        self.joints, gain_names = self._read_joints()
        self.index = self.claim(self.interface, self.joints)
        self.pid = Pid(Gains.from_params(context.entry, gain_names))
        self._tuning = TunablePids.of_controller(context, self.pid, gain_names)
        self._read_limits()
        self._command = np.zeros(len(self.joints))
        self._subscription = context.subscription("command", self.msg_class)

    def starting(self, time_s: float) -> None:
        self._subscription.take()  # drop commands from before the start
        self._command = self._limited(self._start_command())
        self.pid.reset()

    def update(self, time_s: float, dt: float) -> None:
        self._subscription.handle(self._accept)
        error = self._error()
        output = self.pid.update(error, dt)
        self.hardware.command[self.interface][self.index] = output
        self._tuning.publish(time_s, dt, output)
        self._after(time_s, dt, error, output)

    def _accept(self, message):
        values = np.atleast_1d(np.array(message.data, dtype=float))
        if values.shape != self._command.shape or not np.isfinite(values).all():
            self.log.error_throttle(1.0, "%s: command %s ignored, expected one finite number for each of %s"
                                    % (self.context.resolve("command"), values.tolist(), ", ".join(self.joints)))
        else:
            self._command = self._limited(values)

    def _read_joints(self) -> tuple[list[str], list[str]]:
        """The names of the joints and of the parameters with their gains."""
        raise NotImplementedError

    def _start_command(self) -> npt.NDArray[np.float64]:
        """The command (k,) at the start."""
        raise NotImplementedError

    def _error(self) -> npt.NDArray[np.float64]:
        """(k,): command minus state."""
        raise NotImplementedError

    def _read_limits(self):
        """Subclasses with limits read them here."""

    def _limited(self, command):
        return command

    def _after(self, time_s, dt, error, output):
        """Hook for a subclass's publications after an update."""


class _Single(PidController):
    """For the joint in parameter ``joint``, gains in ``pid``; std_msgs/Float64 on ``command``, state on ``state``."""

    msg_class = Float64

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        self._updates = 0
        self._publisher = context.publisher("state", JointControllerState)

    def _read_joints(self) -> tuple[list[str], list[str]]:
        return [self.context.text("joint", "the name of a joint")], ["pid"]

    def _after(self, time_s, dt, error, output):
        self._updates += 1
        if self._updates % STATE_EVERY or not self._publisher.has_listeners:
            return
        gains = self.pid.gains
        message = JointControllerState(
            set_point=self._command[0], error=error[0], time_step=dt, command=output[0], p=gains.p[0], i=gains.i[0],
            d=gains.d[0], i_clamp=gains.i_max[0], antiwindup=bool(gains.antiwindup[0]))
        message.header.stamp = stamp(time_s)
        self._fill(message, float(self.hardware.position[self.index[0]]), float(self.hardware.velocity[self.index[0]]))
        self._publisher.publish(message)

    @staticmethod
    def _fill(message: JointControllerState, position: float, velocity: float) -> None:
        """Fill in the state that is controlled."""
        raise NotImplementedError


class _Position(PidController):
    """Holds positions [rad or m], clamped to the URDF's range; continuous joints take the shorter way."""

    def _read_limits(self):
        robot = self.context.robot
        if robot is None:
            raise ControllerError("%s needs the joint limits of the URDF: parameter %s is missing; load the robot's "
                                  "description" % (self.context.namespace, self.context.in_root("robot_description")))
        joints = [robot.joints[name] for name in self.joints]
        self._around = np.array([joint.type == "continuous" for joint in joints], dtype=bool)

        def end(joint, value, absent):
            return absent if value is None or joint.type == "continuous" else value

        self._lower = np.array([end(joint, joint.limit.lower, -math.inf) for joint in joints])
        self._upper = np.array([end(joint, joint.limit.upper, math.inf) for joint in joints])

    def _limited(self, command):
        return np.clip(command, self._lower, self._upper)

    def _start_command(self) -> npt.NDArray[np.float64]:
        return self.hardware.position[self.index]

    def _error(self) -> npt.NDArray[np.float64]:
        # Command and position of a joint with a range lie within it, and so do all values between them.
        error = self._command - self.hardware.position[self.index]
        if self._around.any():
            error = np.where(self._around, np.remainder(error + math.pi, 2.0 * math.pi) - math.pi, error)
        return error

    @staticmethod
    def _fill(message, position, velocity):
        message.process_value, message.process_value_dot = position, velocity


class EffortJointPositionController(_Position, _Single):
    """effort_controllers/JointPositionController"""


class VelocityJointPositionController(_Position, _Single):
    """velocity_controllers/JointPositionController"""

    interface = VELOCITY


class EffortJointVelocityController(_Single):
    """effort_controllers/JointVelocityController: holds a velocity [rad/s or m/s]."""

    def _start_command(self) -> npt.NDArray[np.float64]:
        return np.zeros(len(self.joints))

    def _error(self) -> npt.NDArray[np.float64]:
        return self._command - self.hardware.velocity[self.index]

    @staticmethod
    def _fill(message, position, velocity):
        message.process_value = velocity


class EffortJointGroupPositionController(_Position):
    """effort_controllers/JointGroupPositionController: joints in ``joints``, gains of each in ``<joint>/pid``,
    std_msgs/Float64MultiArray on ``command``; no state topic."""

    msg_class = Float64MultiArray

    def _read_joints(self) -> tuple[list[str], list[str]]:
        joints = self.context.texts("joints", "a list of joint names")
        return joints, ["%s/pid" % joint for joint in joints]
