# SPDX-License-Identifier: BSD-3-Clause
"""Parameters that change at run time: dynamic_reconfigure's server, with values checked against their ranges."""
from __future__ import annotations

import math
from typing import Any

import rospy
from dynamic_reconfigure.server import Server

# dynamic_reconfigure's names of types -> the Python types of their values.
_KINDS = {"double": (int, float), "int": (int,), "bool": (bool,), "str": (str,)}
# Entries of a configuration that are not parameters.
_GROUPS = "groups"


def check(values: dict[str, Any], table: Any) -> None:
    """Raise ValueError for values that must not get into a configuration.

    values: {name: value}; table: a dynamic_reconfigure type with `min`, `max` and `type`, {name: ...} each. Values
    beyond a parameter's range, also infinity, pass: they are clamped.
    """
    for name, value in values.items():
        if name == _GROUPS:
            continue
        if name not in table.type:
            raise ValueError("there is no parameter '%.100s'; parameters: %s" % (name, ", ".join(table.type)))
        kind = table.type[name]
        if kind in _KINDS and not (isinstance(value, _KINDS[kind]) and isinstance(value, bool) == (kind == "bool")):
            raise ValueError("%s is %.100r, expected a value of type %s" % (name, value, kind))
        if kind == "double" and math.isnan(value):
            raise ValueError("%s is nan, expected %g to %g" % (name, table.min[name], table.max[name]))


class ParameterServer(Server):
    """A dynamic_reconfigure server that also refuses what `check` refuses.

    The original accepts NaN, which is neither below nor above a range, and unknown names with any value, and then
    publishes them with every update. A client gets the refusal as a ServiceException. Raises ValueError at the start
    for invalid values on the ROS parameter server.
    """

    def _clamp(self, config: dict[str, float]) -> None:
        # Called with every configuration before it is accepted.
        check(config, self.type)
        super()._clamp(config)

    def _set_callback(self, request):
        try:
            return super()._set_callback(request)
        except ValueError as error:
            raise rospy.ServiceException(str(error)) from error
