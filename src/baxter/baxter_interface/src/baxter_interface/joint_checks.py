# SPDX-License-Identifier: BSD-3-Clause
"""Checks of names and numbers for a limb; errors list the valid ones. Free of ROS."""
from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from baxter_model import SIDES, joint_names


class UnknownNameError(ValueError, KeyError):
    """The robot has no such name.

    Also a KeyError, which the original SDK raised and programs catch.
    """

    # KeyError would print the text in quotes.
    __str__ = Exception.__str__


def require_side(side: Any) -> str:
    """Return `side` if it names a limb. Raises UnknownNameError."""
    if side not in SIDES:
        raise UnknownNameError("there is no limb %r: the limbs are %s" % (side, " and ".join(map(repr, SIDES))))
    return side


def limb_joint_names(side: str) -> list[str]:
    """List the seven joint names of a limb from shoulder to wrist. Raises UnknownNameError."""
    return list(joint_names(require_side(side)))


def require_joint(name: str, known: list[str]) -> str:
    """Return `name` if it is among the `known` joint names. Raises UnknownNameError."""
    if name not in known:
        raise UnknownNameError("there is no joint %r here: the joints are %s" % (name, ", ".join(known)))
    return name


def require_number(value: Any, what: str) -> float:
    """Return `value` as a finite float. Raises ValueError, which names it `what`."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError("%s must be a finite number, got %r" % (what, value))
    return number


def require_joint_values(values: Any, known: list[str], unit: str) -> dict[str, float]:
    """Return `values` (joint name → number [unit]) as a dict of finite floats.

    Raises UnknownNameError for a joint that is not `known`, ValueError for a value that is not a finite number,
    TypeError for something that is not a mapping.
    """
    if not isinstance(values, Mapping):
        raise TypeError(
            "joint values are a dict of joint name to number [%s], got %r; "
            "a list can be paired with the names: dict(zip(limb.joint_names(), values))" % (unit, values))
    return {
        require_joint(name, known): require_number(value, "%s [%s]" % (name, unit))
        for name, value in values.items()
    }


def beyond_a_turn(angles: dict[str, float]) -> str:
    """Why `angles` (joint name → rad) cannot be reached: one is beyond a full turn, as degrees are; "" if none is."""
    for name, angle in angles.items():
        if abs(angle) > math.tau:
            return ("%s cannot turn to %g rad, more than a full turn. If these are degrees: math.radians(%g) is %.4f"
                    % (name, angle, angle, math.radians(angle)))
    return ""


def require_count(value: float, largest: int, what: str) -> int:
    """Return `value` as an int from 0 to `largest`. Raises ValueError, which names it `what`."""
    number = require_number(value, what)
    if number != int(number) or not 0 <= number <= largest:
        raise ValueError("%s must be a whole number from 0 to %d, got %r" % (what, largest, value))
    return int(number)
