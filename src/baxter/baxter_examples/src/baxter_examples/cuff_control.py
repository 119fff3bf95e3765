# SPDX-License-Identifier: BSD-3-Clause
"""The buttons at an arm's cuff open and close its gripper; squeezing the cuff lights the arm's navigator."""
from __future__ import annotations

import queue
from collections.abc import Callable
from typing import TYPE_CHECKING

from baxter_interface import DigitalIO, Navigator

from .mounted_grippers import mounted_grippers

if TYPE_CHECKING:
    from baxter_interface import Gripper


class CuffControl:
    """One arm's cuff. Call work() regularly: it executes the buttons' requests since the last call.

    Parameters: `lights`: whether the navigator follows the cuff; `say` takes a line of text; `gripper`, the arm's own
    by default.
    """

    def __init__(self, side: str, lights: bool = True, say: Callable[[str], object] = lambda text: None,
                 gripper: Gripper | None = None) -> None:
        self._side = side
        self._say = say
        # Callbacks only note: switching a light waits until it follows, which callbacks must not.
        self._asked = queue.SimpleQueue()
        self._gripper = gripper or mounted_grippers([side], calibrate=True).get(side)
        self._navigator = Navigator(side) if lights else None
        self._open, self._close, self._cuff = (DigitalIO("%s_%s" % (side, name)) for name in (
            "lower_button", "upper_button", "lower_cuff"))
        self._open.state_changed.connect(self._on_open)
        self._close.state_changed.connect(self._on_close)
        self._cuff.state_changed.connect(self._on_cuff)

    def work(self) -> None:
        """Execute the requests. Raises OSError if a light does not follow."""
        while not self._asked.empty():
            self._asked.get()()

    def _on_open(self, pressed) -> None:
        if pressed:
            self._command("open")

    def _on_close(self, pressed) -> None:
        if pressed:
            self._command("close")

    def _command(self, action: str) -> None:
        self._say("%s gripper: %s" % (self._side, action))
        if self._gripper:
            self._asked.put(getattr(self._gripper, action))

    def _on_cuff(self, squeezed) -> None:
        self._say("%s cuff: %s" % (self._side, "squeezed" if squeezed else "let go"))
        navigator = self._navigator
        if navigator:
            self._asked.put(lambda: _light(navigator, squeezed))


def _light(navigator: Navigator, on: bool) -> None:
    navigator.inner_led = navigator.outer_led = on
