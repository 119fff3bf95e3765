# SPDX-License-Identifier: BSD-3-Clause
"""Parse untrusted JSON objects from messages, within limits. ROS-free.

Python's own reader raises other errors on some valid JSON: brackets a thousand deep, integers of any length.
"""
from __future__ import annotations

import json
import re
from typing import Any

LONGEST = 10000  # characters of a text; the robot's longest is about 100
DEEPEST = 8  # objects and lists within each other; a tool.s weight takes six
MAX_DIGITS = 18  # of an integer: what 64 bits hold
LARGEST = 1e15  # magnitude of a number
SHOWN = 100  # characters of a text that an error quotes

# A string, whose end may be missing, or a bracket.
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"?|[][{}]', re.DOTALL)
_BRACKETS = {"{": 1, "[": 1, "}": -1, "]": -1}


class JsonRefused(ValueError):
    """The text is not a JSON object, or exceeds a limit; the message says what was found and what is allowed."""


def read_object(text: str) -> dict[str, Any]:
    """The JSON object in ``text`` as a dict, an empty one for white space.

    NaN and Infinity are accepted, as Python writes them. Raises :class:`JsonRefused`.
    """
    if not text.strip():
        return {}
    fault = _fault(text)
    if fault:
        raise JsonRefused("%s: %s" % (_quoted(text), fault))
    try:
        values = json.loads(text, parse_int=_integer, parse_float=_number)
    except (ValueError, RecursionError) as error:
        raise JsonRefused("%s is not a JSON object (%s)" % (_quoted(text), error)) from None
    if not isinstance(values, dict):
        raise JsonRefused("%s is not a JSON object" % _quoted(text))
    return values


def _fault(text: str) -> str:
    if len(text) > LONGEST:
        return "%d characters, and at most %d are read" % (len(text), LONGEST)
    depth = 0
    for token in _TOKEN.findall(text):
        depth += _BRACKETS.get(token, 0)
        if depth > DEEPEST:
            return "nested deeper than %d, which is all that is read" % DEEPEST
    return ""


def _integer(digits: str) -> int:
    if len(digits) > MAX_DIGITS + digits.startswith("-"):
        raise ValueError("an integer of %d digits; at most %d are read" % (len(digits), MAX_DIGITS))
    return _bounded(int(digits), digits)


def _number(text: str) -> float:
    return _bounded(float(text), text)


def _bounded(value: Any, text: str) -> Any:
    if not abs(value) <= LARGEST:
        raise ValueError("the number %s; its magnitude may be up to %g" % (_quoted(text), LARGEST))
    return value


def _quoted(text: str) -> str:
    return repr(text if len(text) <= SHOWN else text[:SHOWN] + " ...")
