# SPDX-License-Identifier: BSD-3-Clause
"""Parameters that change at run time: dynamic_reconfigure's server, with values checked against their ranges."""
import math

import rospy
from dynamic_reconfigure.server import Server

# dynamic_reconfigure's names of types -> what a value of one may be.
_KINDS = {"double": (int, float), "int": (int,), "bool": (bool,), "str": (str,)}
# What stands beside the parameters in a configuration.
_GROUPS = "groups"


def check(values, table):
    """Raise ValueError for what must not get into a configuration.

    values: {name: value}; table: a dynamic_reconfigure type with `min`, `max` and `type`, {name: ...} each. What is
    beyond a parameter's range, infinity too, may pass: it is clamped.
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
    """A dynamic_reconfigure server that refuses what its own does not notice, in the words of `check`.

    dynamic_reconfigure's takes NaN, which is neither below nor above a range, and names that no parameter has, with any
    value, which go out with every update from then on. A client gets the refusal as a ServiceException. Raises
    ValueError at the start for what stands on the ROS parameter server.
    """

    def _clamp(self, config):
        # Called with everything that may become the configuration, before it does.
        check(config, self.type)
        super()._clamp(config)

    def _set_callback(self, request):
        try:
            return super()._set_callback(request)
        except ValueError as error:
            raise rospy.ServiceException(str(error)) from error
