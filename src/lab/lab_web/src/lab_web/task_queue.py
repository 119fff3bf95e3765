# SPDX-License-Identifier: BSD-3-Clause
"""Slow tasks of pages, done one after the other in a thread. No ROS."""
from __future__ import annotations

import queue
from typing import TYPE_CHECKING

from lab_web.lab import RobotError
from loop_ros.faults import SURVIVED, described

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from loop_ros.faults import Faults


class TaskQueue:
    """``told(client, code, text)``; ``faults`` (:class:`loop_ros.faults.Faults`) notes errors that nobody foresaw."""

    def __init__(self, told: Callable[[int | None, str, str], object], faults: Faults) -> None:
        self._told = told
        self._faults = faults
        self._queue = queue.SimpleQueue()

    def add(self, client: int | None, work: Callable[..., object], *arguments: Any) -> None:
        """Have ``work(*arguments)`` done; its RobotError is told to the page ``client`` (None: to no one)."""
        self._queue.put((client, work, arguments))

    def run(self, ends: Callable[[], bool], last: Callable[[], object] | None = None) -> None:
        """Work until ``ends()``; then ``last()``, and what it adds."""
        while not ends():
            self._work(0.2)
        if last is not None:
            last()
        while self._work(0.0):
            pass

    def _work(self, timeout_s: float) -> bool:
        try:
            client, work, arguments = self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return False
        try:
            work(*arguments)
        except SURVIVED as error:
            is_known = isinstance(error, RobotError)
            if not is_known:
                self._faults.note("a page's errand", error)
            if client is not None:
                self._told(client, "refused", str(error) if is_known else described(error))
        return True
