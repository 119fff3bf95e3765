# SPDX-License-Identifier: BSD-3-Clause
"""The base class of controllers that goals of an action start, as those of robot_controllers."""
from controller_manager import Controller
from loop_ros.action_server import ActionServer


class GoalController(Controller):
    """A controller with one goal at a time; ``busy``: whether it has one. Subclasses have ``_on_goal(handle)`` and
    ``_on_cancel(handle)``, and write ``_goal``, the handle of the goal that they follow."""

    def __init__(self, name, hardware, context, crew):
        """``crew``: what starts controllers; its ``start(controller)`` returns None, or why it may not start."""
        super().__init__(name, hardware, context)
        self._crew, self._runs, self._time_s = crew, False, 0.0
        self._goal = self._server = None

    def serve(self, action, action_class):
        """Open the action, at the end of a subclass's constructor."""
        self._server = ActionServer(self.context, action, action_class, self._on_goal, self._on_cancel)

    @property
    def busy(self):
        return self._goal is not None

    def starting(self, time_s):
        self._runs = True

    def stopping(self, time_s):
        self._runs = False
        self._end("the controller was stopped")

    def idle(self, time_s):
        self._time_s = time_s
        self._server.spin(time_s)

    def _take(self, handle, refusal=None):
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

    def _end(self, why):
        handle, self._goal = self._goal, None
        if handle is not None:
            handle.cancel(text=why)
