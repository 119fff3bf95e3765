# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of the ROS master in the protocol's form, and back."""
from __future__ import annotations

import base64
import binascii
import math
import re
from typing import Any
from xmlrpc.client import Binary, DateTime

from web_bridge.errors import BridgeError, FieldError, shown

_DEEPEST = 20
#: Characters that XML cannot hold.
_NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_INTEGERS = range(-2 ** 31, 2 ** 31)


def shown_parameter(name: str, value: Any) -> dict[str, Any] | None:
    """{name, value, type where JSON does not tell it}, or None for a value that has no form: NaN, a date."""
    if isinstance(value, Binary | bytes):
        data = value.data if isinstance(value, Binary) else value
        return {"name": name, "value": base64.b64encode(data).decode(), "type": "byte_array"}
    if not _is_json(value):
        return None
    parameter = {"name": name, "value": value}
    if isinstance(value, float):
        parameter["type"] = "float64"
    # A list of numbers with 1.0 in it would come back from a page with 1.
    elif isinstance(value, list) and any(isinstance(one, float) for one in value) and _are_numbers(value):
        parameter["type"] = "float64_array"
    return parameter


def _is_json(value: Any) -> bool:
    if isinstance(value, dict):
        return all(map(_is_json, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_is_json, value))
    if isinstance(value, float):
        return math.isfinite(value)
    return not isinstance(value, Binary | bytes | DateTime)


def _are_numbers(values: list[Any]) -> bool:
    return all(isinstance(one, int | float) and not isinstance(one, bool) for one in values)


def given_value(parameter: dict[str, Any]) -> Any:
    """The value of a parameter that a client sets. Raises FieldError for one that the master cannot hold."""
    value: Any = parameter.get("value")
    kind = parameter.get("type")
    if kind == "byte_array":
        try:
            return Binary(base64.b64decode(value, validate=True))
        except (TypeError, ValueError, binascii.Error):
            raise FieldError("value is %s; base64 is expected for byte_array" % shown(value)) from None
    if kind == "float64":
        if not _are_numbers([value]):
            raise FieldError("value is %s; a number is expected for float64" % shown(value))
        return _float(value)
    if kind == "float64_array":
        if not isinstance(value, list) or not _are_numbers(value):
            raise FieldError("value is %s; a list of numbers is expected for float64_array" % shown(value))
        return [_float(one) for one in value]
    if kind is not None:
        raise FieldError("type is %s; byte_array, float64 and float64_array are known" % shown(kind))
    _check(value, 0)
    return value


def _float(value: Any) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise FieldError("%s is too large for a float" % shown(value))
    return number


def _check(value: Any, depth: int) -> None:
    if depth > _DEEPEST:
        raise FieldError("lists and objects are nested more than %d times" % _DEEPEST)
    if isinstance(value, dict):
        for key, one in value.items():
            if not key or "/" in key or _NOT_IN_XML.search(key):
                raise FieldError("%s is no name of a parameter" % shown(key))
            _check(one, depth + 1)
    elif isinstance(value, list):
        for one in value:
            _check(one, depth + 1)
    elif value is None:
        raise FieldError("null inside of a value; the master cannot hold it")
    elif isinstance(value, int) and value not in _INTEGERS:
        raise FieldError("%d does not fit into 32 bits; the master cannot hold it (type float64 can)" % value)
    elif isinstance(value, float):
        _float(value)
    elif isinstance(value, str) and _NOT_IN_XML.search(value):
        raise FieldError("%s holds a character that the master's XML cannot hold" % shown(value))


def flattened(tree: Any, name: str = "") -> dict[str, Any]:
    """{absolute name: value} of all leaves of the master's tree; an empty namespace is a leaf."""
    if not isinstance(tree, dict) or not tree:
        return {name: tree} if name else {}
    found = {}
    for key, value in tree.items():
        found.update(flattened(value, "%s/%s" % (name, key)))
    return found


def at(tree: dict[str, Any], name: str) -> Any:
    """The value of a parameter or namespace. Raises KeyError."""
    for key in name.strip("/").split("/"):
        if not isinstance(tree, dict):
            raise KeyError(name)
        tree = tree[key]
    return tree


def check_name(name: str) -> None:
    """Raise BridgeError for the root, which holds everything."""
    if name.strip("/") == "":
        raise BridgeError("the root of all parameters cannot be set at once; name one")
