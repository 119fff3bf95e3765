# SPDX-License-Identifier: BSD-3-Clause
"""Signals, whose connections hold weak references to their slots."""
from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from typing import Any


class Signal:
    """Call every connected slot with the arguments that the signal is called with.

    Slots are functions or bound methods, held weakly: connecting an object's method does not keep the object alive,
    and a slot that has gone is skipped. (So keep a reference to a lambda, or it is dropped at once.)
    """

    def __init__(self) -> None:
        self._references = []
        self._lock = threading.Lock()

    def connect(self, slot: Callable[..., Any] | str) -> None:
        """Call `slot` from now on. Connecting it a second time changes nothing."""
        reference = _weak_reference(slot)
        with self._lock:
            if reference not in self._references:
                self._references.append(reference)

    def disconnect(self, slot: Callable[..., Any]) -> None:
        """Stop calling `slot`. It does no harm if it was not connected."""
        reference = _weak_reference(slot)
        with self._lock:
            self._references = [known for known in self._references if known != reference]

    def __call__(self, *args: Any, **kwargs: Any) -> None:
        """Call the slots in the order of their connection; errors of a slot reach the caller."""
        with self._lock:
            self._references = [reference for reference in self._references if reference() is not None]
            references = list(self._references)
        # Outside the lock: a slot may connect or disconnect.
        for reference in references:
            slot = reference()
            if slot is not None:
                slot(*args, **kwargs)


def _weak_reference(slot: Callable[..., Any] | str) -> weakref.ReferenceType | weakref.WeakMethod:
    if not callable(slot):
        raise TypeError("a slot is a function or a bound method, not %r" % (slot,))
    # A plain weak reference to a bound method would be dead at once: each access makes a new method object.
    return weakref.WeakMethod(slot) if hasattr(slot, "__self__") and hasattr(slot, "__func__") else weakref.ref(slot)
