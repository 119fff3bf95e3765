# SPDX-License-Identifier: BSD-3-Clause
"""Messages to plain values and back, by the rules of rosbridge. Free of ROS: a message is an object with ``__slots__``
and ``_slot_types``, and its class is asked from the caller.

Out, for JSON: uint8[] and char[] are base64 text, time and duration {secs, nsecs}, NaN and infinities None. Out, for
CBOR: uint8[] and char[] are bytes, other numeric arrays of variable length are typed arrays (RFC 8746), floats are as
they are. In: missing fields keep their defaults; a field that the type lacks, or a value of another kind, is a
FieldError.
"""
from __future__ import annotations

import array
import base64
import binascii
import math
import re
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import cbor2

from command_line.options import counted
from web_bridge.errors import FieldError, shown

if TYPE_CHECKING:
    from genpy import Duration, Message, Time

_TYPE = re.compile(r"([^\[]+)(\[(\d*)\])?\Z")
_OF_BYTES = ("uint8", "char")
_SIGNED = {"int8": 8, "byte": 8, "int16": 16, "int32": 32, "int64": 64}
_UNSIGNED = {"uint8": 8, "char": 8, "uint16": 16, "uint32": 32, "uint64": 64}
RANGES = {**{name: (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) for name, bits in _SIGNED.items()},
          **{name: (0, (1 << bits) - 1) for name, bits in _UNSIGNED.items()}}
_FLOATS = ("float32", "float64")
_TIMES = {"time": RANGES["uint32"], "duration": RANGES["int32"]}
#: Type of an array's elements -> (tag of RFC 8746, little-endian; letter of Python's module array).
TYPED_ARRAYS = {"uint16": (69, "H"), "uint32": (70, "I"), "uint64": (71, "Q"), "int8": (72, "b"), "byte": (72, "b"),
                "int16": (77, "h"), "int32": (78, "i"), "int64": (79, "q"), "float32": (85, "f"), "float64": (86, "d")}
_LETTER_OF_TAG = {64: "B", **dict(TYPED_ARRAYS.values())}


def parts_of(slot_type: str) -> tuple[str, int | None]:
    """("float64", None) of float64, ("float64", 0) of float64[], ("float64", 36) of float64[36]."""
    [(base, brackets, length)] = _TYPE.findall(slot_type)
    return base, int(length or 0) if brackets else None


def _base64(data: bytes) -> str:
    return base64.b64encode(bytes(data)).decode("ascii")


def _json_float(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _json_floats(values: Sequence[float]) -> list[float | None]:
    # The sum of finite values can overflow; then the slow way gives the same result.
    return list(values) if math.isfinite(sum(values)) else [value if math.isfinite(value) else None for value in values]


def _time(value: Time | Duration) -> dict[str, int]:
    return {"secs": value.secs, "nsecs": value.nsecs}


def _times(values: Any):
    return [_time(value) for value in values]


def _same(value: Any) -> Any:
    return value


class JsonForm:
    """Values for JSON."""

    def scalar(self, base: str) -> Callable[..., Any]:
        return _json_float if base in _FLOATS else _same

    def array(self, base: str, length: int) -> Callable[..., Any]:
        if base in _OF_BYTES:
            return _base64
        return _json_floats if base in _FLOATS else list


class CborForm:
    """Values for CBOR."""

    def scalar(self, base: str) -> Callable[..., Any]:
        return _same

    def array(self, base: str, length: int) -> Callable[..., Any]:
        if base in _OF_BYTES:
            return bytes
        if length or base not in TYPED_ARRAYS:
            return list
        tag, letter = TYPED_ARRAYS[base]

        def typed(values: Sequence[float]) -> cbor2.CBORTag:
            numbers = array.array(letter, values)
            if sys.byteorder == "big":
                numbers.byteswap()
            return cbor2.CBORTag(tag, numbers.tobytes())
        return typed


class Writer:
    """Messages to values of one form. ``class_of(type name)`` returns the class of a message type."""

    def __init__(self, class_of: Callable[[str], type], form: JsonForm | CborForm) -> None:
        self._class_of = class_of
        self._form = form
        self._converters: dict[type, Callable[[Any], dict[str, Any]]] = {}

    def values(self, message: Any) -> dict[str, Any]:
        """The message's fields as a dict of plain values."""
        return self._of_class(type(message))(message)

    def _of_class(self, cls: type) -> Callable[..., Any]:
        if cls not in self._converters:
            fields = [(name, self._of_type(slot)) for name, slot in zip(cls.__slots__, cls._slot_types, strict=True)]

            def converter(message: Any) -> dict[str, Any]:
                return {name: convert(getattr(message, name)) for name, convert in fields}
            self._converters[cls] = converter
        return self._converters[cls]

    def _of_type(self, slot_type: str) -> Callable[..., Any]:
        base, length = parts_of(slot_type)
        if base in _TIMES:
            return _time if length is None else _times
        if "/" in base:
            convert = self._of_class(self._class_of(base))
            return convert if length is None else (lambda messages: [convert(message) for message in messages])
        return self._form.scalar(base) if length is None else self._form.array(base, length)


def from_tag(tag: cbor2.CBORTag) -> list[float]:
    """The numbers of a typed array as a list; raises FieldError for other tags and for lengths that do not fit."""
    letter = _LETTER_OF_TAG.get(tag.tag)
    if letter is None or not isinstance(tag.value, bytes):
        raise FieldError("CBOR tag %s is not read; the tags of numeric arrays, 64 to 86, are" % shown(tag.tag))
    numbers = array.array(letter)
    try:
        numbers.frombytes(tag.value)
    except ValueError:
        raise FieldError("a typed array of %d bytes cannot hold numbers of %d bytes each"
                         % (len(tag.value), numbers.itemsize)) from None
    if sys.byteorder == "big":
        numbers.byteswap()
    return numbers.tolist()


class Reader:
    """Values into messages.

    ``class_of(type name)`` returns the class of a message type; ``now()`` a time with ``secs`` and ``nsecs``, for
    headers and for the text "now".
    """

    def __init__(self, class_of: Callable[[str], type], now: Callable[[], Time]) -> None:
        self._class_of = class_of
        self._now = now

    def fill(self, message: Any, values: Any, unread: list[str] | None = None) -> Message:
        """Lay ``values``, a dict, or a list in the order of the fields, over a message. Raises FieldError.

        rosbridge_suite passes over some values without a word: those of a list that are too many, and what is no time
        where one is expected. With ``unread``, a list, they are passed over and a text about each is appended to it;
        without, they raise.
        """
        if values is None:
            return message
        if isinstance(values, list | tuple):
            if len(values) > len(message.__slots__):
                _pass_over("%s for %s, which has %s"
                           % (counted(len(values), "value"), message._type,
                              counted(len(message.__slots__), "field")), unread)
            values = dict(zip(message.__slots__, values, strict=False))
        self._lay(message, values, "", unread)
        return message

    def _lay(self, message: Any, values: Any, path: str, unread: list[str] | None) -> None:
        if not isinstance(values, dict):
            raise FieldError("%s is %s; an object with the fields of %s is expected"
                             % (path or "the message", shown(values), message._type))
        if message._type == "std_msgs/Header":
            now = self._now()
            message.stamp.secs, message.stamp.nsecs = now.secs, now.nsecs
        types = dict(zip(message.__slots__, message._slot_types, strict=True))
        for name, value in values.items():
            if name not in types:
                raise FieldError("%s has no field %s; it has %s"
                                 % (message._type, shown(name), ", ".join(types) or "none"))
            where = path + "." + name if path else name
            setattr(message, name, self._value(types[name], value, getattr(message, name), where, unread))

    def _value(self, slot_type: str, value: Any, default: Any, path: str, unread: list[str] | None) -> Any:
        base, length = parts_of(slot_type)
        if length is None:
            return self._one(base, value, default, path, unread)
        if base in _OF_BYTES:
            found = _bytes(base, value, path)
        elif isinstance(value, list | tuple):
            found = self._many(base, value, path, unread)
        else:
            raise FieldError("%s is %s; a list is expected (%s)" % (path, shown(value), slot_type))
        if length and len(found) != length:
            raise FieldError("%s has %s; %d are expected" % (path, counted(len(found), "element"), length))
        return found

    def _many(self, base: str, values: Sequence[Any], path: str, unread: list[str] | None) -> list[Any]:
        kinds = set(map(type, values))
        # Long arrays of numbers are checked without a call for each.
        if base in _FLOATS and kinds <= {float}:
            return list(values)
        if base in RANGES and kinds == {int}:
            least, greatest = RANGES[base]
            if least <= min(values) and max(values) <= greatest:
                return list(values)
        if base in _TIMES or "/" in base:
            return [self._one(base, value, self._empty(base), "%s[%d]" % (path, i), unread)
                    for i, value in enumerate(values)]
        return [_scalar(base, value, "%s[%d]" % (path, i)) for i, value in enumerate(values)]

    def _empty(self, base: str) -> Time | Duration | Message:
        """An element of an array. Times come from the caller's clock, as no type of a message has their names."""
        if base not in _TIMES:
            return self._class_of(base)()
        now = self._now()
        return type(now)() if base == "time" else now - now

    def _one(self, base: str, value: Any, default: Any, path: str, unread: list[str] | None) -> Any:
        if base in _TIMES:
            return self._time(base, value, default, path, unread)
        if "/" not in base:
            return _scalar(base, value, path)
        self._lay(default, value, path, unread)
        return default

    def _time(self, base: str, value: Any, default: Time | Duration, path: str,
              unread: list[str] | None) -> Time | Duration:
        if value == "now":
            now = self._now()
            value = {"secs": now.secs, "nsecs": now.nsecs}
        if not isinstance(value, dict) or not set(value) <= {"secs", "nsecs"}:
            _pass_over('%s is %s; {"secs": …, "nsecs": …} or "now" is expected' % (path, shown(value)), unread)
            value = {part: value[part] for part in ("secs", "nsecs") if isinstance(value, dict) and part in value}
        for part in value:
            _integer(value[part], _TIMES[base], "%s.%s" % (path, part), base)
        default.secs, default.nsecs = value.get("secs", default.secs), value.get("nsecs", default.nsecs)
        return default


def _pass_over(text: str, unread: list[str] | None) -> None:
    if unread is None:
        raise FieldError(text)
    unread.append(text)


def _bytes(base: str, value: Any, path: str) -> bytes:
    if isinstance(value, bytes):
        return value
    if isinstance(value, str):
        try:
            return binascii.a2b_base64(value)
        except ValueError as error:
            raise FieldError("%s is no base64 text: %s" % (path, error)) from None
    if isinstance(value, list | tuple):
        for i, one in enumerate(value):
            _integer(one, RANGES["uint8"], "%s[%d]" % (path, i), base)
        return bytes(value)
    raise FieldError("%s is %s; base64 text or a list of numbers is expected" % (path, shown(value)))


def _integer(value: Any, limits: tuple[int, int], path: str, base: str) -> int:
    if type(value) is not int:
        raise FieldError("%s is %s; an integer is expected (%s)" % (path, shown(value), base))
    if not limits[0] <= value <= limits[1]:
        raise FieldError("%s is %s; %s goes from %d to %d" % (path, shown(value), base, *limits))
    return value


def _scalar(base: str, value: Any, path: str) -> Any:
    if base in RANGES:
        return _integer(value, RANGES[base], path, base)
    if base in _FLOATS:
        if type(value) not in (int, float):
            raise FieldError("%s is %s; a number is expected (%s)" % (path, shown(value), base))
        try:
            return float(value)
        except OverflowError:
            raise FieldError("%s is an integer too large for %s" % (path, base)) from None
    wanted, name = (bool, "true or false") if base == "bool" else (str, "a text")
    if type(value) is not wanted:
        raise FieldError("%s is %s; %s is expected (%s)" % (path, shown(value), name, base))
    return value
