# SPDX-License-Identifier: BSD-3-Clause
"""Methods for moveit_msgs/AllowedCollisionMatrix: the bodies that may touch each other."""
from __future__ import annotations

from collections.abc import Iterable

from moveit_msgs.msg import AllowedCollisionEntry, AllowedCollisionMatrix


def set_default(matrix: AllowedCollisionMatrix, obj: str | Iterable[str], allow: bool) -> None:
    """Let ``obj``, a name or a list of names, touch (or not) everything that it has no entry with."""
    values = dict(zip(matrix.default_entry_names, matrix.default_entry_values, strict=True))
    values.update(dict.fromkeys(_names(obj), bool(allow)))
    matrix.default_entry_names, matrix.default_entry_values = list(values), list(values.values())


def set_allowed(matrix: AllowedCollisionMatrix, obj: str | Iterable[str], other: str | Iterable[str] | None = None,
                allow: bool = True) -> None:
    """Let ``obj`` and ``other``, names or lists of names, touch (or not); without ``other`` obj and everything else."""
    for entry in matrix.entry_values:
        entry.enabled = list(entry.enabled)  # a tuple in a message that was received
    objects = _names(obj)
    if other is None:
        set_default(matrix, objects, allow)
    others = _names(other) if other is not None else list(matrix.entry_names)
    for name in dict.fromkeys([*objects, *others]):
        _add_entry(matrix, name)
    position = {name: number for number, name in enumerate(matrix.entry_names)}
    for a in objects:
        for b in others:
            if a != b:
                for row, column in ((a, b), (b, a)):
                    matrix.entry_values[position[row]].enabled[position[column]] = bool(allow)


def _names(value: str | Iterable[str]) -> list[str]:
    return [value] if isinstance(value, str) else list(value)


def _add_entry(matrix: AllowedCollisionMatrix, name: str) -> None:
    """A row and a column for ``name``; with the others it gets the values of the defaults."""
    if name in matrix.entry_names:
        return
    defaults = dict(zip(matrix.default_entry_names, matrix.default_entry_values, strict=True))
    row = [defaults.get(name, False) or defaults.get(other, False) for other in matrix.entry_names]
    for entry, allowed in zip(matrix.entry_values, row, strict=True):
        entry.enabled.append(allowed)
    matrix.entry_names.append(name)
    matrix.entry_values.append(AllowedCollisionEntry(enabled=[*row, False]))


def add_methods() -> None:
    """Give the message type these methods, as programs written for MoveIt expect."""
    AllowedCollisionMatrix.set_default = set_default  # pyright: ignore[reportAttributeAccessIssue]  (new ones)
    AllowedCollisionMatrix.set_allowed = set_allowed  # pyright: ignore[reportAttributeAccessIssue]
