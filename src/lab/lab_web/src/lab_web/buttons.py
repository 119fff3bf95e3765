# SPDX-License-Identifier: BSD-3-Clause
"""Buttons that pages press and hold, and wheels that they turn. No ROS."""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from lab_web.lab import RobotError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from lab_web.task_queue import TaskQueue


class Buttons:
    """``switch(action, name, steps)``: "press", "release" or "turn"; it may wait, and raises RobotError. ``tasks``:
    :class:`lab_web.task_queue.TaskQueue` for these alone. ``pressed(names)`` is told which buttons the robot has
    pressed: before a press, and after a release.
    """

    def __init__(self, switch: Callable[[str, str, int], object], tasks: TaskQueue,
                 pressed: Callable[[set[str]], object] = lambda names: None) -> None:
        self._switch = switch
        self._tasks = tasks
        self._lock = threading.Lock()
        self._held = set()
        # Of the tasks' thread alone.
        self._pressed = set()
        self._tell_pressed = pressed

    def press(self, client: int, operation: dict[str, Any]) -> None:
        """An operation "press" of a page: ``name``, and whether it is ``pressed`` now. Raises RobotError."""
        name, pressed = _name(operation), operation.get("pressed")
        if not isinstance(pressed, bool):
            raise RobotError("\"pressed\" is %r; true or false is expected" % (pressed,))
        with self._lock:
            (self._held.add if pressed else self._held.discard)(name)
            self._tasks.add(client, self._switch_button, "press" if pressed else "release", name)

    def turn(self, client: int, operation: dict[str, Any]) -> None:
        """An operation "turn" of a page: ``name`` of a wheel, ``steps``. Raises RobotError."""
        name, steps = _name(operation), operation.get("steps")
        if isinstance(steps, bool) or not isinstance(steps, int) or abs(steps) > 255:
            raise RobotError("a wheel is turned by a whole number of steps, up to 255, not by %r" % (steps,))
        self._tasks.add(client, self._switch, "turn", name, steps)

    def release_all(self) -> None:
        """Release what is held: its page has stopped the robot, fallen silent, gone, or lost the control."""
        with self._lock:
            for name in self._held:
                self._tasks.add(None, self._switch_button, "release", name)
            self._held.clear()

    def _switch_button(self, action: str, name: str) -> None:
        if action == "press":
            self._pressed.add(name)
            self._tell_pressed(self._pressed)
        try:
            self._switch(action, name, 0)
        except RobotError:
            self._not_pressed(name)
            raise
        if action == "release":
            self._not_pressed(name)

    def _not_pressed(self, name: str) -> None:
        self._pressed.discard(name)
        self._tell_pressed(self._pressed)


def _name(operation: dict[str, Any]) -> str:
    name = operation.get("name")
    if not isinstance(name, str) or not name:
        raise RobotError("\"name\" is %r; the name of a button or a wheel is expected" % (name,))
    return name
