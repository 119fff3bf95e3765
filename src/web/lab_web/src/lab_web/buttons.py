# SPDX-License-Identifier: BSD-3-Clause
"""Buttons that pages press and hold, and wheels that they turn. No ROS."""
import threading

from lab_web.lab import RobotError


class Buttons:
    """``switch(action, name, steps)``: "press", "release" or "turn"; it may wait, and raises RobotError. ``errands``:
    :class:`lab_web.errands.Errands` for these alone.
    """

    def __init__(self, switch, errands):
        self._switch = switch
        self._errands = errands
        self._lock = threading.Lock()
        self._held = set()

    def press(self, client, operation):
        """An operation "press" of a page: ``name``, and whether it is ``pressed`` now. Raises RobotError."""
        name, pressed = _name(operation), operation.get("pressed")
        if not isinstance(pressed, bool):
            raise RobotError("\"pressed\" is %r; true or false is expected" % (pressed,))
        with self._lock:
            (self._held.add if pressed else self._held.discard)(name)
            self._errands.add(client, self._switch, "press" if pressed else "release", name, 0)

    def turn(self, client, operation):
        """An operation "turn" of a page: ``name`` of a wheel, ``steps``. Raises RobotError."""
        name, steps = _name(operation), operation.get("steps")
        if isinstance(steps, bool) or not isinstance(steps, int) or abs(steps) > 255:
            raise RobotError("a wheel is turned by a whole number of steps, up to 255, not by %r" % (steps,))
        self._errands.add(client, self._switch, "turn", name, steps)

    def release_all(self):
        """Release what is held: its page has stopped the robot, fallen silent, gone, or lost the control."""
        with self._lock:
            for name in self._held:
                self._errands.add(None, self._switch, "release", name, 0)
            self._held.clear()


def _name(operation):
    name = operation.get("name")
    if not isinstance(name, str) or not name:
        raise RobotError("\"name\" is %r; the name of a button or a wheel is expected" % (name,))
    return name
