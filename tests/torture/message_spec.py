# SPDX-License-Identifier: BSD-3-Clause
"""A message's structure as plain data, and its bytes on the wire (http://wiki.ros.org/msg). No ROS needed.

A value of a message is a dict: field name to number, bool, string, list or dict; ``time`` and ``duration`` are pairs
(seconds, nanoseconds). A string may be given as bytes, which need not be UTF-8.
"""
import re
import struct
from dataclasses import dataclass

FORMATS = {
    "bool": "B", "int8": "b", "uint8": "B", "byte": "b", "char": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d", "time": "II", "duration": "ii",
}
FLOATS = ("float32", "float64")
TIMES = ("time", "duration")
VARIABLE = -1
_LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class Field:
    """One field. kind: a primitive's name, "string", or the MessageSpec of a nested message; length: None for a single
    value, VARIABLE, or the length of a fixed array."""

    name: str
    kind: object
    length: int | None = None


@dataclass(frozen=True)
class MessageSpec:
    """A message's type, e.g. "std_msgs/Bool", and its fields."""

    type: str
    fields: tuple[Field, ...]


def spec_of(message_class, class_of):
    """The MessageSpec of a generated message class; ``class_of("pkg/Type")`` gives the classes of nested messages."""
    fields = []
    for name, declared in zip(message_class.__slots__, message_class._slot_types, strict=True):
        base, length = re.fullmatch(r"([^\[]+)(?:\[(\d*)\])?", declared).groups()
        size = None if length is None else int(length) if length else VARIABLE
        kind = base if base in FORMATS or base == "string" else spec_of(class_of(base), class_of)
        fields.append(Field(name, kind, size))
    return MessageSpec(message_class._type, tuple(fields))


def encode(spec, value):
    """The bytes of a message, without the leading length.

    Raises struct.error for a number that its field cannot hold, KeyError for a missing field.
    """
    return b"".join(_encode_field(field, value[field.name]) for field in spec.fields)


def _encode_field(field, value):
    if field.length is None:
        return _encode_one(field.kind, value)
    count = _LENGTH.pack(len(value)) if field.length == VARIABLE else b""
    return count + b"".join(_encode_one(field.kind, one) for one in value)


def _encode_one(kind, value):
    if isinstance(kind, MessageSpec):
        return encode(kind, value)
    if kind == "string":
        data = value if isinstance(value, bytes) else value.encode("utf-8", "surrogatepass")
        return _LENGTH.pack(len(data)) + data
    if kind in TIMES:
        return struct.pack("<" + FORMATS[kind], *value)
    return struct.pack("<" + FORMATS[kind], value)


def leaves(spec, value, path=()):
    """(path, kind, value) of all primitive values in a message; a path is a tuple of names and list indices."""
    for field in spec.fields:
        here, found = (*path, field.name), value[field.name]
        several = [((*here, k), one) for k, one in enumerate(found)] if field.length is not None else [(here, found)]
        for where, one in several:
            if isinstance(field.kind, MessageSpec):
                yield from leaves(field.kind, one, where)
            else:
                yield where, field.kind, one


def replaced(value, path, new):
    """A copy of a message's value in which the value at ``path`` (as in `leaves`) is replaced."""
    first, *rest = path
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[first] = replaced(copy[first], rest, new) if rest else new
    return copy
