# SPDX-License-Identifier: BSD-3-Clause
"""A gripper of one joint that opens, closes, and detects that it holds something."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from control_msgs.msg import GripperCommandAction, GripperCommandResult

from controller_manager import EFFORT, POSITION, Controller, Gains, Pid
from controller_manager.pid_tuning import TunablePids
from loop_ros.action_server import ActionServer, GoalHandle

if TYPE_CHECKING:
    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware


class GripperController(Controller):
    """control_msgs/GripperCommand on the action ``gripper_cmd``: position [m or rad], max_effort [N or Nm].

    Parameters: ``joint``, required; ``goal_tolerance`` (0.01) of the position; ``max_effort`` (0), which applies until
    the first goal and while holding; ``stall_velocity_threshold`` (0.001) and ``stall_timeout`` (1 s): a motion slower
    than the threshold for longer than the timeout is a stall. A goal succeeds within the tolerance and is aborted in a
    stall; the drive continues. Base of the classes below.
    """

    interface: str

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        self.joint = context.text("joint", "the name of the gripper's joint")
        self.index = self.claim(self.interface, [self.joint])
        self._tolerance = abs(context.number("goal_tolerance", 0.01))
        self._default_effort = abs(context.number("max_effort", 0.0))
        self._still_velocity = abs(context.number("stall_velocity_threshold", 0.001))
        self._stall_s = abs(context.number("stall_timeout", 1.0))
        self._running = False
        self._goal: GoalHandle | None = None
        self._target, self._max_effort = 0.0, self._default_effort
        self._moved_s = 0.0
        self._time_s = 0.0
        self._server = ActionServer(context, "gripper_cmd", GripperCommandAction, self._on_goal, self._on_cancel)

    def idle(self, time_s: float) -> None:
        self._time_s = time_s
        self._server.spin(time_s)

    def starting(self, time_s: float) -> None:
        self._running = True
        self._hold()

    def update(self, time_s: float, dt: float) -> None:
        self._time_s = time_s
        self._server.spin(time_s)
        self._drive(dt)
        if self._goal is not None:
            self._watch(self._goal, time_s)

    def stopping(self, time_s: float) -> None:
        self._running = False
        self._end_goal("the controller was stopped")

    def _drive(self, dt: float) -> None:
        """Command the joint towards the target."""
        raise NotImplementedError

    def _hold(self):
        self._target = float(self.hardware.position[self.index[0]])
        self._max_effort = self._default_effort

    def _on_goal(self, handle):
        command = handle.goal.command
        if not self._running:
            handle.reject(text="the controller does not run")
        elif not (math.isfinite(command.position) and math.isfinite(command.max_effort)):
            handle.reject(text="position %r and max_effort %r must be finite" % (command.position, command.max_effort))
        else:
            self._end_goal("another goal has come")
            handle.accept()
            self._goal = handle
            self._target, self._max_effort = command.position, abs(command.max_effort)
            self._moved_s = self._time_s

    def _on_cancel(self, handle):
        if handle is self._goal:
            self._end_goal("")
            self._hold()

    def _end_goal(self, why):
        handle, self._goal = self._goal, None
        if handle is not None:
            handle.cancel(text=why)

    def _watch(self, goal: GoalHandle, time_s: float) -> None:
        """End the goal if the joint has arrived, or does not move any more."""
        position = self.hardware.position[self.index[0]]
        # Time may have gone back in a reset.
        self._moved_s = min(self._moved_s, time_s)
        if abs(self._target - position) < self._tolerance:
            self._goal = None
            goal.succeed(self._result(position, reached_goal=True))
        elif abs(self.hardware.velocity[self.index[0]]) > self._still_velocity:
            self._moved_s = time_s
        elif time_s - self._moved_s > self._stall_s:
            self._goal = None
            goal.abort(self._result(position, stalled=True))

    def _result(self, position, **flags):
        return GripperCommandResult(position=position, effort=self.hardware.effort[self.index[0]], **flags)


class PositionGripperActionController(GripperController):
    """position_controllers/GripperActionController: the position is commanded, max_effort has no effect."""

    interface = POSITION

    def _drive(self, dt):
        self.hardware.command[POSITION][self.index] = self._target


class EffortGripperActionController(GripperController):
    """effort_controllers/GripperActionController: a PID with ``gains/<joint>`` makes an effort, at most max_effort."""

    interface = EFFORT

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        names = ["gains/" + self.joint]
        self._pid = Pid(Gains.from_params(context.entry, names))
        self._tuning = TunablePids.of_controller(context, self._pid, names)

    def starting(self, time_s: float) -> None:
        super().starting(time_s)
        self._pid.reset()

    def _drive(self, dt):
        error = self._target - self.hardware.position[self.index]
        effort = self._pid.update(error, dt, -self.hardware.velocity[self.index])
        self._tuning.publish(self._time_s, dt, effort)
        self.hardware.command[EFFORT][self.index] = np.clip(effort, -self._max_effort, self._max_effort)
