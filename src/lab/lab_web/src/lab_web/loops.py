# SPDX-License-Identifier: BSD-3-Clause
"""Loops of threads that rest while there is no page. No ROS."""
from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from threading import Event

# Between two looks at whether all ends, while there is no page [s].
_LOOK_S = 0.5


def attended(present: Event, loop: Callable[[Callable[[], bool]], object]) -> Callable[[Callable[[], bool]], None]:
    """A function of ``ends`` that runs ``loop(ends)`` while the event ``present`` is set, until ``ends()``."""
    def run(ends):
        while not ends():
            if present.wait(_LOOK_S):
                loop(lambda: ends() or not present.is_set())
    return run
