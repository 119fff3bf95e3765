# SPDX-License-Identifier: BSD-3-Clause
"""Warnings that repeat."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Hashable
    from typing import Protocol

    class _Log(Protocol):
        def warn(self, text: str, /) -> None: ...

PERIOD_S = 5.0  # [simulated s] between two warnings of one kind


class Warnings:
    """Passes warnings to the log, one of each kind in PERIOD_S."""

    def __init__(self, log: _Log) -> None:
        """log: has ``warn(text)``."""
        self._log = log
        self._last = {}  # {kind: when [s]}

    def warn(self, time_s: float, kind: Hashable, text: str) -> None:
        """Log ``text`` at time_s [s] unless a warning of this kind (anything hashable) came within the period."""
        last = self._last.get(kind)
        if last is None or not last <= time_s < last + PERIOD_S:
            self._last[kind] = time_s
            self._log.warn(text)

    def reset(self) -> None:
        """Forget earlier warnings: each kind is logged again."""
        self._last.clear()
