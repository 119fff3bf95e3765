# SPDX-License-Identifier: BSD-3-Clause
"""Parses `/topic/field[0]:other` to curves, which read their value from a message. Free of ROS.

Message types are described by a function: type name -> {field: type}, types written as in .msg files.
"""
from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

NUMBERS = frozenset(
    "bool byte char int8 uint8 int16 uint16 int32 uint32 int64 uint64 float32 float64 time duration".split())
# Times are plotted in seconds; their parts can also be plotted.
TIME_PARTS = {"time": {"secs": "uint32", "nsecs": "uint32"}, "duration": {"secs": "int32", "nsecs": "int32"}}
_TOKEN = re.compile(r"(\w+)(?:\[(\d+)\])?", re.ASCII)
_ARRAY = re.compile(r"(.+)\[(\d*)\]")


class PlotError(Exception):
    """The request cannot be plotted; the text says what can."""


class UnknownTopic(PlotError):
    """No topic of that name yet."""


@dataclass(frozen=True)
class FieldCurve:
    """One number of a topic's messages. steps: (field, index or None) from the message inwards."""

    label: str
    steps: tuple

    def value(self, message: Any) -> float:
        """Return the number as float; raises PlotError if this message's array is too short."""
        for name, index in self.steps:
            message = getattr(message, name)
            if index is not None:
                if index >= len(message):
                    raise PlotError("%s: the array has %d element(s), counted from 0" % (self.label, len(message)))
                message = message[index]
        return message.to_sec() if hasattr(message, "to_sec") else float(message)


def expand(argument: str) -> list[str]:
    """Return the paths of one argument: `/t/a:b,/u/c` is /t/a, /t/b and /u/c. Raises PlotError."""
    paths = []
    for part in filter(None, (part.strip() for part in argument.split(","))):
        first, *others = part.split(":")
        folder = first.rpartition("/")[0]
        for path in (first, *("%s/%s" % (folder, other) for other in others)):
            path = "/" + path.strip("/")
            if not all(others) or not all(_TOKEN.fullmatch(token) for token in path[1:].split("/")):
                raise PlotError("'%s' is not of the form /topic/field, /topic/field[0] or /topic/a:b:c" % part)
            paths.append(path)
    if not paths:
        raise PlotError("nothing to plot in '%s': name a topic and a field, as in /topic/field" % argument)
    return paths


def split(path: str, topics: Iterable[str]) -> tuple[str, list[str]]:
    """Return (topic, field tokens) of a path; if several topics match, the longest one. Raises UnknownTopic.

    topics: names of all topics.
    """
    tokens = path[1:].split("/")
    for count in range(len(tokens), 0, -1):
        topic = "/" + "/".join(tokens[:count])
        if topic in topics:
            return topic, tokens[count:]
    likely = difflib.get_close_matches(path, topics, n=3, cutoff=0.4)
    hint = "topics of similar names: %s" % ", ".join(likely) if likely else "rostopic list shows the topics"
    raise UnknownTopic("no topic begins '%s' so far; %s" % (path, hint))


def curves(topic: str, tokens: Sequence[str], type_name: str, fields_of: Callable[..., Any]) -> list[FieldCurve]:
    """Return the Curves for field tokens in messages of a type; a message means all its numbers.

    Raises PlotError, which lists the existing fields. fields_of: function from the name of a message type to {field:
    type}.
    """
    here, steps, label = type_name, (), topic
    for token in tokens:
        fields = _fields(here, fields_of)
        if not fields:
            raise PlotError("%s is one %s and has no field '%s'" % (label, here, token))
        match = _TOKEN.fullmatch(token)
        name, index = match.groups() if match else (token, None)
        if name not in fields:
            raise PlotError("%s (%s) has no field '%s'; it has %s" % (label, here, name, _listing(fields)))
        label += "/" + token
        here = _element(label, fields[name], None if index is None else int(index))
        steps += ((name, None if index is None else int(index)),)
    if here in NUMBERS:
        return [FieldCurve(label, steps)]
    fields = _fields(here, fields_of)
    numbers = [name for name, kind in fields.items() if kind in NUMBERS]
    if not numbers:
        what = "it has %s" % _listing(fields) if fields else "only numbers can be plotted"
        raise PlotError("%s (%s) is not a number; %s" % (label, here, what))
    return [FieldCurve("%s/%s" % (label, name), (*steps, (name, None))) for name in numbers]


def _fields(type_name: str, fields_of: Callable[[Any], Any]) -> dict[str, str]:
    if type_name in TIME_PARTS:
        return TIME_PARTS[type_name]
    return {} if type_name in NUMBERS or type_name == "string" else fields_of(type_name)


def _element(label: str, declared: str, index: int | None) -> str:
    """The type that a field of the declared type, with or without an index, has. Raises PlotError."""
    array = _ARRAY.fullmatch(declared)
    if array is None:
        if index is not None:
            raise PlotError("%s: this field is not an array but one %s; leave out the index" % (label, declared))
        return declared
    element, length = array.groups()
    if index is None:
        raise PlotError("%s is an array (%s): choose an element, as in %s[0]" % (label, declared, label))
    if length and index >= int(length):
        raise PlotError("%s: the array has %s elements, counted from 0" % (label, length))
    return element


def _listing(fields: dict[str, str]) -> str:
    return ", ".join("%s (%s)" % item for item in fields.items())
