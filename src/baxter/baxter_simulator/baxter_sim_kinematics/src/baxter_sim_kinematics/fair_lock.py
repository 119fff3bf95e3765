# SPDX-License-Identifier: BSD-3-Clause
"""A fair lock, which goes to the thread that has waited longest."""
from __future__ import annotations

import collections
import threading


class FairLock:
    """A lock, as a context manager, which threads get in the order of their requests.

    Python's own lock usually goes to the thread that has just released it: a loop over ten thousand poses would keep
    all other threads waiting until its end.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()  # of what follows, and never held for long
        self._is_taken = False
        self._gates = collections.deque()

    def __enter__(self) -> FairLock:
        with self._lock:
            if not self._is_taken:
                self._is_taken = True
                return self
            gate = threading.Lock()
            gate.acquire()
            self._gates.append(gate)
        gate.acquire()  # until it is handed over
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            if self._gates:
                self._gates.popleft().release()
            else:
                self._is_taken = False
