# SPDX-License-Identifier: BSD-3-Clause
"""The base class of controllers that goals of an action start, as those of robot_controllers."""
from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from controller_manager import Controller
from loop_ros.action_server import ActionServer, GoalHandle

if TYPE_CHECKING:
    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware


class Crew(Protocol):
    """Starts controllers: None, or why one may not start."""

    def start(self, controller: GoalController) -> str | None: ...


class GoalController(Controller):
    """A controller with one goal at a time; ``busy``: whether it has one. Subclasses write ``_goal``, the handle of the
    goal that they follow."""

    _server: ActionServer  # from :meth:`serve` on

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext, crew: Crew) -> None:
        super().__init__(name, hardware, context)
        self._crew, self._runs, self._time_s = crew, False, 0.0
        self._goal: GoalHandle | None = None

    def serve(self, action: str, action_class: type) -> None:
        """Open the action, at the end of a subclass's constructor."""
        self._server = ActionServer(self.context, action, action_class, self._on_goal, self._on_cancel)

    @property
    def busy(self) -> bool:
        return self._goal is not None

    def starting(self, time_s: float) -> None:
        self._runs = True

    def stopping(self, time_s: float) -> None:
        self._runs = False
        self._end("the controller was stopped")

    def idle(self, time_s: float) -> None:
        self._time_s = time_s
        self._server.spin(time_s)

    def _on_goal(self, handle: GoalHandle) -> None:
        raise NotImplementedError

    def _on_cancel(self, handle: GoalHandle) -> None:
        raise NotImplementedError

    def _take(self, handle: GoalHandle, refusal: str | None = None) -> bool:
        """Whether a goal is followed from now on, in place of the one before: unless there is a ``refusal``, or the
        controller may not start; then it is rejected with the reason."""
        if refusal is None and not self._runs:
            refusal = self._crew.start(self)
        if refusal is not None:
            handle.reject(text=refusal)
            return False
        self._end("another goal took its place")
        handle.accept()
        self._goal = handle
        return True

    def _end(self, why: str) -> None:
        handle, self._goal = self._goal, None
        if handle is not None:
            handle.cancel(text=why)
