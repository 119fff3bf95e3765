# SPDX-License-Identifier: BSD-3-Clause
"""Message types as lists of plain definitions. No ROS: classes are asked from the caller."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from web_bridge.values import RANGES, parts_of

_PLAIN = {*RANGES, "bool", "float32", "float64", "string", "time", "duration"}


class Definition(NamedTuple):
    """A type; one entry for each field, and one for each constant. Lengths: -1 no array, 0 of variable length."""

    type: str
    fieldnames: list
    fieldtypes: list
    fieldarraylen: list
    examples: list
    constnames: list
    constvalues: list


_TIME = (["secs", "nsecs"], ["int32", "int32"], [-1, -1], ["0", "0"], [], [])


def definitions(cls: type, class_of: Callable[..., Any]) -> list[Definition]:
    """The definition of a message class, and after it those of the types in its fields, each once.

    ``class_of(type name)`` returns a message class.
    """
    found = {}
    _add(cls._type, cls, class_of, found)
    return list(found.values())


def _add(name: str, cls: type | None, class_of: Callable[[Any], Any], found: dict[str, Definition]) -> None:
    if name in found:
        return
    if cls is None:
        found[name] = Definition(name, *_TIME)
        return
    types, lengths = [], []
    for slot in cls._slot_types:
        base, length = parts_of(slot)
        types.append(base)
        lengths.append(-1 if length is None else length)
    constants = {key: value for key, value in vars(cls).items()
                 if not key.startswith("_") and isinstance(value, bool | int | float | str)}
    empty = cls()
    examples = [_example(getattr(empty, slot), base, length)
                for slot, base, length in zip(cls.__slots__, types, lengths, strict=True)]
    found[name] = Definition(name, list(cls.__slots__), types, lengths, examples, list(constants),
                             [str(value) for value in constants.values()])
    for base in types:
        if base in ("time", "duration"):
            _add(base, None, class_of, found)
        elif base not in _PLAIN:
            _add(base, class_of(base), class_of, found)


def _example(value: Any, base: str, length: int) -> str:
    if length >= 0:
        return "[]"
    return "{}" if base in ("time", "duration") or base not in _PLAIN else str(value)
