# SPDX-License-Identifier: BSD-3-Clause
"""Topics that are subscribed to only while somebody needs them. Without ROS.

Each message wakes its thread, and a simulator does not even make those without a subscriber.
"""
from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

# Between two looks at who needs it [s].
_LOOK_S = 1.0


class Demand:
    """Calls ``listen()`` at the first :meth:`need`, and ``rest()`` when nobody has needed it for ``linger_s`` [s]: no
    :meth:`need` since then, and ``is_needed()``, which is asked once a second, was false.

    ``clock`` and ``timer``, a ``threading.Timer``, are replaceable for tests.
    """

    def __init__(self, listen: Callable[[], object], rest: Callable[[], object], linger_s: float,
                 is_needed: Callable[[], bool] = lambda: False, clock: Callable[[], float] = time.monotonic,
                 timer: Callable[..., Any] = threading.Timer) -> None:
        self._listen, self._rest, self._linger_s, self._is_needed = listen, rest, linger_s, is_needed
        self._clock, self._timer = clock, timer
        self._lock = threading.Lock()
        self._listens, self._needed_until = False, 0.0

    def need(self) -> None:
        """Any thread: somebody needs it now. When it returns, ``listen()`` has been called; what that raises, this
        raises."""
        with self._lock:
            self._needed_until = self._clock() + self._linger_s
            if not self._listens:
                self._listen()
                self._listens = True
                self._look_in(min(_LOOK_S, self._linger_s))

    def _look_in(self, seconds: float) -> None:
        timer = self._timer(seconds, self._look)
        timer.daemon = True
        timer.start()

    def _look(self) -> None:
        with self._lock:
            now = self._clock()
            try:
                is_needed = self._is_needed()
            except Exception:
                # The error is the timer's thread's; who needs it is asked again.
                self._look_in(_LOOK_S)
                raise
            if is_needed:
                self._needed_until = now + self._linger_s
            if now < self._needed_until:
                self._look_in(min(_LOOK_S, self._needed_until - now))
            else:
                # First: if the rest fails, the next need still listens.
                self._listens = False
                self._rest()
