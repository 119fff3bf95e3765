# SPDX-License-Identifier: BSD-3-Clause
"""Objects in the world: their names, and where pages put them. No ROS."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from lab_web.lab import RobotError
from web_bridge.errors import shown

if TYPE_CHECKING:
    from collections.abc import Collection
    from typing import Any

#: Where a new object stands or begins to fall (x, y, z) in the world [m]; None: the others, above a table.
NEW_PLACES = {"cafe_table": (1.0, 0.0, 0.0), "table": (1.2, 0.0, 0.0), None: (0.75, 0.0, 1.1)}
#: Objects are put this far from the world's origin at most [m].
FARTHEST_M = 20.0
_LARGEST = 1e9


def free_name(thing: str, taken: Collection[str]) -> str:
    """``thing``, or the first of thing_2, thing_3 ... that is not ``taken``."""
    number = 1
    while (name := thing if number == 1 else "%s_%d" % (thing, number)) in taken:
        number += 1
    return name


def pose_of(operation: dict[str, Any]) -> tuple[list[float], list[float]]:
    """(position (3) [m], orientation (x, y, z, w) of length 1) of a page's operation. Raises RobotError."""
    numbers = []
    for key, count in (("position", 3), ("orientation", 4)):
        values = operation.get(key)
        # Comparisons also hold for whole numbers that no float can hold, and for NaN.
        is_fine = isinstance(values, list) and len(values) == count and all(
            isinstance(value, int | float) and abs(value) <= _LARGEST for value in values)
        if not is_fine:
            raise RobotError("\"%s\" is %s; %d numbers are expected" % (key, shown(values), count))
        numbers.append(values)
    position, orientation = numbers
    if max(map(abs, position)) > FARTHEST_M:
        raise RobotError("%s is too far away; up to %g m from the origin are possible" % (position, FARTHEST_M))
    length = math.hypot(*orientation)
    if length < 0.5:
        raise RobotError("\"orientation\" is %s; x, y, z, w of length 1 are expected" % orientation)
    return position, [value / length for value in orientation]
