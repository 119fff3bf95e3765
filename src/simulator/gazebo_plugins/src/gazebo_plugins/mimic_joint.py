# SPDX-License-Identifier: BSD-3-Clause
"""A joint that follows another one, as the fingers of many grippers do."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.urdf_extras import unscoped

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext


class MimicJoint(ModelPlugin):
    """``libroboticsgroup_upatras_gazebo_mimic_joint_plugin.so`` and its older names. Elements: ``joint``,
    ``mimicJoint``, which is kept at ``multiplier`` (1) times the position of ``joint`` plus ``offset`` (0);
    ``sensitiveness`` (0 rad or m: a smaller difference is left alone). With ``hasPID`` it is pulled with at most
    ``maxEffort`` (1), else held without yielding.
    """

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        self._joint, self._follower = (self._index(tag) for tag in ("joint", "mimicJoint"))
        self._multiplier, self._offset = self._number("multiplier", 1.0), self._number("offset", 0.0)
        self._tolerance = self._number("sensitiveness", 0.0)
        pulled = context.element.find("hasPID") is not None
        self._effort = np.array([self._number("maxEffort", 1.0)]) if pulled else None

    def update(self, time_s: float, dt: float) -> None:
        model = self.context.model
        position = model.read_joints()[0]
        target = self._multiplier * position[self._joint] + self._offset
        if self._effort is not None:
            model.drive_position(self._follower, target, self._effort)
        elif abs(float((target - position[self._follower])[0])) >= self._tolerance:
            model.carry(self._follower, target)

    def _index(self, tag: str) -> np.ndarray:
        name = unscoped(self.context.model.name, self.context.element_text(tag, ""))
        known = self.context.model.joint_names
        if name not in known:
            raise PluginError("%s: <%s> is '%s', expected one of the joints %s"
                              % (self._what, tag, name, ", ".join(known) or "(there are none)"))
        return self.context.model.index([name])

    def _number(self, tag: str, default: float) -> float:
        text = self.context.element_text(tag)
        try:
            value = default if text is None else float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise PluginError("%s: <%s> is '%s', expected a number" % (self._what, tag, text))
        return value
