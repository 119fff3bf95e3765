# SPDX-License-Identifier: BSD-3-Clause
"""An asyncio loop in a separate thread, which runs tornado's servers. No ROS."""
from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from typing import Any


class Later:
    """A call in the loop that :meth:`LoopThread.later` planned."""

    def __init__(self, loop) -> None:
        self._loop = loop
        self._handle = None
        self._cancelled = False

    def start(self, delay_s: float, function: Callable[..., Any]) -> None:
        if not self._cancelled:
            self._handle = self._loop.call_later(delay_s, function)

    def cancel(self) -> None:
        """From any thread; a call that has begun goes on."""
        self._cancelled = True
        if self._handle is not None:
            self._loop.call_soon_threadsafe(self._handle.cancel)


class LoopThread:
    """Starts with the constructor; ``stop`` ends it."""

    def __init__(self, name: str = "web") -> None:
        self.loop = asyncio.new_event_loop()
        self._lock = threading.Lock()
        self._calls = []  # what soon() was given and the loop has not yet done
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        asyncio.set_event_loop(self.loop)
        self.loop.run_forever()
        self.loop.run_until_complete(self.loop.shutdown_asyncgens())
        self.loop.close()

    def soon(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Call a function in the loop; from any thread, nothing where the loop has ended."""
        with self._lock:
            self._calls.append((function, arguments))
            is_first = len(self._calls) == 1
        # A message for ten clients is ten calls: the loop is woken up once.
        if is_first:
            try:
                self.loop.call_soon_threadsafe(self._do)
            except RuntimeError:
                if not self.loop.is_closed():
                    raise
                self._calls.clear()

    def _do(self) -> None:
        with self._lock:
            calls, self._calls = self._calls, []
        for function, arguments in calls:
            self.loop.call_soon(function, *arguments)

    def later(self, delay_s: float, function: Callable[..., Any]) -> Later:
        """Call a function in the loop after a delay, unless the returned object's ``cancel()`` comes first; from any
        thread.
        """
        planned = Later(self.loop)
        self.soon(planned.start, delay_s, function)
        return planned

    def run(self, coroutine: Coroutine[Any, Any, Any], timeout_s: float = 30.0) -> Any:
        """The result of a coroutine that runs in the loop; not from the loop's own thread."""
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result(timeout_s)

    def stop(self, timeout_s: float = 5.0) -> None:
        """End the loop and wait for its thread."""
        self.soon(self.loop.stop)
        self._thread.join(timeout_s)
