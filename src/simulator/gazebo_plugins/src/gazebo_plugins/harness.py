# SPDX-License-Identifier: BSD-3-Clause
"""A harness in which a model hangs, on a winch."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from std_msgs.msg import Bool, Float32

from bullet_sim import Pose
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.urdf_extras import unscoped
from urdf_model.transforms import pose_matrix

if TYPE_CHECKING:
    from typing import Any

    from gazebo_ros.model_plugin import PluginContext

_MAX_N = 1e6  # of a joint without an effort limit
_FASTEST_M_PER_S = 10.0


class Harness(ModelPlugin):
    """``libgazebo_ros_harness.so`` and ``libHarnessPlugin.so``: holds a link on a ``<joint>`` of the plugin, prismatic,
    from the world to the link, until std_msgs/Bool ``/MODEL/harness/detach`` lets it go.

    std_msgs/Float32 ``/MODEL/harness/velocity`` [m/s] winds it along the joint's axis, between its limits and with its
    effort at most. The velocity is kept exactly, whatever the gains of ``<winch>``.
    """

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        joint = self._joint()
        name = (joint.findtext("child") or "").strip()
        self._link = unscoped(context.model.name, name)
        if self._link not in context.model.link_names:
            raise PluginError("%s: <child> is '%s', expected one of the links %s"
                              % (self._what, name, ", ".join(context.model.link_names)))
        axis = np.array(self._numbers(joint, "axis/xyz", "0 0 1", 3))
        if not axis.any():
            raise PluginError("%s: <xyz> is zero, expected a direction such as 0 0 1" % self._what)
        place = self._numbers(joint, "pose", "0 0 0 0 0 0", 6)
        self._axis = pose_matrix(rpy=place[3:])[:3, :3] @ axis / np.linalg.norm(axis)  # in the link's frame
        self._low, self._high, effort = (self._numbers(joint, "axis/limit/" + tag, default, 1)[0] for tag, default in (
            ("lower", "-1e16"), ("upper", "1e16"), ("effort", "-1")))
        self._effort = _MAX_N if effort < 0.0 else min(effort, _MAX_N)
        self._velocities = context.subscription("/%s/harness/velocity" % context.model.name, Float32)
        self._detach = context.subscription("/%s/harness/detach" % context.model.name, Bool)
        self._hanging = None
        self._attach()

    def _joint(self) -> Any:
        joints = self.context.element.findall("joint")
        wanted = (self.context.element.findtext("winch/joint") or "").strip()
        joint = next((joint for joint in joints if joint.get("name") == wanted), joints[0] if joints else None)
        if joint is None or joint.get("type") != "prismatic" or (joint.findtext("parent") or "").strip() != "world":
            found = "missing" if joint is None else "the %s joint '%s' from '%s'" % (
                joint.get("type"), joint.get("name"), (joint.findtext("parent") or "").strip())
            raise PluginError("%s: its winch is %s, expected a prismatic <joint> from the <parent> world to a link"
                              % (self._what, found))
        others = [other.get("name", "") for other in joints if other is not joint]
        if others:
            self.context.log.warn("%s: of its joints, '%s' alone is served, not %s"
                                  % (self._what, joint.get("name"), ", ".join(others)))
        return joint

    def _numbers(self, element: Any, path: str, default: str, count: int) -> tuple[float, ...]:
        text = (element.findtext(path) or "").strip() or default
        try:
            values = tuple(float(word) for word in text.split())
        except ValueError:
            values = ()
        if len(values) != count or any(map(math.isnan, values)):
            raise PluginError("%s: <%s> is '%s', expected %d number%s"
                              % (self._what, path.rpartition("/")[2], text, count, "s" * (count > 1)))
        return values

    def _attach(self) -> None:
        self._start = self.context.model.link_pose(self._link).matrix()
        self._way, self._speed = 0.0, 0.0
        self._hanging = self.context.world.hang(self.context.model, self._link, self._effort)

    def update(self, time_s: float, dt: float) -> None:
        self._velocities.handle(self._take_velocity)
        self._detach.handle(self._take_detach)
        if self._hanging is None:
            return
        self._way = min(max(self._way + self._speed * dt, self._low), self._high)
        there = self._start.copy()
        there[:3, 3] += self._way * (self._start[:3, :3] @ self._axis)
        self._hanging.hold(Pose.from_matrix(there))

    def _take_velocity(self, message: Float32) -> None:
        if not abs(message.data) <= _FASTEST_M_PER_S:
            self.context.log.warn_throttle(5.0, "%s: a velocity of %g m/s was commanded, expected at most %g"
                                           % (self._what, message.data, _FASTEST_M_PER_S))
            return
        self._speed = message.data

    def _take_detach(self, message: Bool) -> None:
        if message.data and self._hanging is not None:
            self._hanging.let_go()
            self._hanging = None

    def reset(self) -> None:
        """It hangs again where the model starts."""
        if self._hanging is not None:
            self._hanging.let_go()
        self._attach()

    def close(self) -> None:
        if self._hanging is not None:
            self._hanging.let_go()
            self._hanging = None
