# SPDX-License-Identifier: BSD-3-Clause
"""The action server that moves a gripper: robot/end_effector/<gripper>/gripper_action."""
from __future__ import annotations

import errno
import math
from typing import TYPE_CHECKING, Any

from control_msgs.msg import GripperCommandAction, GripperCommandFeedback, GripperCommandResult

from baxter_interface import CHECK_VERSION, Gripper, RobotEnable
from baxter_interface.goal_loop import GoalLoop, GoalWork
from baxter_interface.gripper_types import OPEN, clip_percent
from baxter_model import ELECTRIC, SUCTION
from baxter_model.readiness import ENABLE

if TYPE_CHECKING:
    from baxter_interface.dynamic_parameters import ParameterServer

# Number of steps that the fingers get to release an object before they count as stalled.
STEPS_TO_BEGIN = 4
# Suction time of a cup for a goal without time-out [s].
LONG_SUCTION_S = 3600.0


class GripperActionServer:
    """Moves the gripper of the "left" or "right" arm to the goal's `position`, 0 closed to 100 open.

    `max_effort` is the force of an electric gripper, or the vacuum threshold of a cup [%]: 0 for the parameter, -1 for
    100. A cup opens at 100 and sucks below. Parameters, from the mapping `reconfig_server.config` at each goal, for
    each gripper by name: timeout [s] (below 0: none), goal, velocity, moving_force, holding_force,
    vacuum_threshold [%], blow_off [s].
    A goal ends once: succeeded (at the position, or stalled on something with the force asked for), aborted with a text
    that says why, or preempted; when it is not reached the gripper is stopped. The result is the last feedback.
    Waits for the gripper, and raises, as Gripper does; checks its version; clears its errors and calibrates it. Raises
    OSError if that fails, or if the gripper is neither electric nor a suction cup.
    """

    def __init__(self, gripper: str, reconfig_server: ParameterServer) -> None:
        self._gripper = Gripper(gripper, CHECK_VERSION)
        self._config = reconfig_server
        name, kind = self._gripper.name, self._gripper.type()
        actions = {ELECTRIC.name: _Electric, SUCTION.name: _Suction}.get(kind or "")
        if actions is None:
            raise OSError(errno.ENODEV, "%s is of type %s; this server moves electric and suction grippers"
                          % (name, kind))
        self._actions = actions
        self._prepare()
        self._loop = GoalLoop("robot/end_effector/%s/gripper_action" % name, GripperCommandAction, RobotEnable(), name,
                              self._begin)

    def clean_shutdown(self) -> None:
        """End the goal, if there is one."""
        self._loop.clean_shutdown()

    def _prepare(self) -> None:
        if self._gripper.error():
            self._gripper.reset(block=True)
        if self._gripper.error():
            raise OSError(errno.EIO, "%s has an error that a reset does not clear" % self._gripper.name)
        if self._gripper.type() == ELECTRIC.name and not self._gripper.calibrated():
            self._gripper.calibrate(block=True)
            if not self._gripper.calibrated():
                raise OSError(errno.EIO, "%s could not be calibrated: is the robot enabled (%s)?"
                              % (self._gripper.name, ENABLE))

    def _begin(self, handle: Any):
        command = handle.get_goal().command
        position, effort = command.position, command.max_effort
        settings = {name[len(self._gripper.name) + 1:]: value for name, value in self._config.config.items()
                    if name.startswith(self._gripper.name)}
        refusal = ""
        if not math.isfinite(position) or not math.isfinite(effort):
            refusal = "position and max_effort must be finite numbers, got %r and %r" % (position, effort)
        action = self._actions(self._gripper, settings, position, effort)
        result = GripperCommandResult()

        def step() -> bool:
            result.position, result.effort, result.stalled, result.reached_goal = action.observe()
            handle.publish_feedback(GripperCommandFeedback(result.position, result.effort, result.stalled,
                                                           result.reached_goal))
            if result.stalled or result.reached_goal:
                return True
            action.push()
            return False

        return GoalWork(
            step, stop=lambda: self._gripper.stop(block=False),
            missed=lambda: "%s is at %.1f %%, its goal is %.1f %%" % (
                self._gripper.name, self._gripper.position(), position),
            make_result=lambda: result, timeout_s=settings["timeout"], refusal=refusal)


def _effort(asked: float, default: float) -> float:
    """The force [%] for a goal's max_effort."""
    return default if asked == 0.0 else 100.0 if asked == -1.0 else clip_percent(asked)


class _Electric:
    def __init__(self, gripper: Gripper, settings: dict[str, float], position: float, effort: float) -> None:
        self._gripper = gripper
        self._position = clip_percent(position)
        self._dead_zone = settings["goal"]
        self._force = _effort(effort, settings["moving_force"])
        self._wanted = {"velocity": settings["velocity"], "moving_force": self._force,
                        "holding_force": settings["holding_force"], "dead_zone": self._dead_zone}
        self._pushes = 0

    def observe(self) -> tuple[float, float, bool, bool]:
        """(position [%], force [%], stalled, reached)."""
        position, force = self._gripper.position(), self._gripper.force()
        closes = self._position < position
        held = force > self._force or (closes and self._gripper.gripping())
        stalled = held and self._pushes >= STEPS_TO_BEGIN and not self._gripper.moving()
        return position, force, stalled, abs(position - self._position) < self._dead_zone

    def push(self) -> None:
        self._pushes += 1
        if {name: self._gripper.parameters().get(name) for name in self._wanted} != self._wanted:
            self._gripper.set_parameters(self._wanted)
        self._gripper.command_position(self._position, block=False)


class _Suction:
    def __init__(self, gripper: Gripper, settings: dict[str, float], position: float, effort: float) -> None:
        self._gripper = gripper
        self._opens = position >= OPEN
        self._timeout_s = settings["timeout"] if settings["timeout"] >= 0.0 else LONG_SUCTION_S
        self._wanted = {"vacuum_sensor_threshold": _effort(effort, settings["vacuum_threshold"]),
                        "blow_off_seconds": settings["blow_off"]}
        self._pushed = False

    def observe(self) -> tuple[float, float, bool, bool]:
        """(position [%], vacuum [%], stalled, reached)."""
        reached = self._pushed and (not (self._gripper.sucking() or self._gripper.blowing()) if self._opens
                                    else self._gripper.gripping())
        return self._gripper.position(), self._gripper.vacuum_sensor() or 0.0, False, reached

    def push(self) -> None:
        if self._pushed:
            return
        self._pushed = True
        self._gripper.set_parameters(self._wanted)
        if self._opens:
            self._gripper.open(block=False)
        else:
            self._gripper.close(block=False, timeout=self._timeout_s)
