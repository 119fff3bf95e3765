# SPDX-License-Identifier: BSD-3-Clause
"""Changes that services made to the physics, with the values from before, for a reset. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


class Changes:
    """One entry for each change, with a function that undoes it."""

    def __init__(self) -> None:
        self._undo = {}

    def note(self, key: tuple[str, ...], undo: Callable[[], object]) -> None:
        """Remember ``undo()`` for the first change of ``key``, a tuple that begins with the model's name or ""."""
        self._undo.setdefault(key, undo)

    def take_back(self) -> None:
        """Undo every change, the last one first. If one cannot be undone, raises after the others are undone."""
        undo, self._undo = list(self._undo.values()), {}
        failed = None
        for step in reversed(undo):
            try:
                step()
            except Exception as error:  # noqa: BLE001  (raised below: the others are undone first)
                failed = error
        if failed is not None:
            raise failed

    def forget(self, model_name: str) -> None:
        """Drop the changes of a deleted model."""
        self._undo = {key: undo for key, undo in self._undo.items() if key[0] != model_name}
