# SPDX-License-Identifier: BSD-3-Clause
"""The fields of a client's operation, checked."""
from __future__ import annotations

from typing import Any

from web_bridge.errors import FieldError, shown

#: A number: milliseconds, messages or characters of a client's wish, of at most so many.
NUMBER = (int, float)
_LARGEST_NUMBER = 1e12
_NEEDED = object()


def type_field(operation: dict[str, Any], default: Any = _NEEDED) -> Any:
    """The field ``type``; rosbridge_suite reads "/std_msgs//String" as well. Raises FieldError."""
    given = field(operation, "type", str, default)
    return given and "/".join(part for part in given.split("/") if part)


def field(operation: dict[str, Any], name: str, kind: Any, default: Any = _NEEDED) -> Any:
    """A field of an operation (dict); ``kind``: a type, or NUMBER. JSON's null counts as missing. Raises FieldError."""
    value = operation.get(name)
    if value is None:
        if default is _NEEDED:
            raise FieldError("the field %s is missing" % name)
        return default
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool) \
            or (kind is NUMBER and not abs(value) <= _LARGEST_NUMBER):
        wanted = "a number from -%g to %g" % (_LARGEST_NUMBER, _LARGEST_NUMBER) if kind is NUMBER else kind.__name__
        raise FieldError("%s is %s; %s is expected" % (name, shown(value), wanted))
    return value
