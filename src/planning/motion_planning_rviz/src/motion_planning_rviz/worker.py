# SPDX-License-Identifier: BSD-3-Clause
"""One thread that runs functions in turn, so that their data needs no locks."""
from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Hashable


class Worker:
    """Calls functions in the order of their arrival. ``on_error``: function of an exception that one raised."""

    def __init__(self, on_error: Callable[[Exception], None]) -> None:
        self._on_error = on_error
        self._wake = threading.Condition()
        self._waiting: deque[tuple[Hashable, Callable[[], None]]] = deque()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="worker", daemon=True)
        self._thread.start()

    def put(self, function: Callable[[], None], key: Hashable = None) -> None:
        """Call ``function()`` later. With a ``key`` it replaces the waiting one of the same key: only the newest pose
        of a dragged marker matters."""
        with self._wake:
            if key is not None and self._waiting and self._waiting[-1][0] == key:
                self._waiting.pop()
            self._waiting.append((key, function))
            self._wake.notify()

    def end(self) -> None:
        """Stop, and wait for the function that is running."""
        with self._wake:
            self._ended = True
            self._waiting.clear()
            self._wake.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._ended)
                if self._ended:
                    return
                _, function = self._waiting.popleft()
            try:
                function()
            except Exception as error:  # the thread must survive any error of a request
                self._on_error(error)
