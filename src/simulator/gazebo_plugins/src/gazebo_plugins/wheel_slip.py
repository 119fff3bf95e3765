# SPDX-License-Identifier: BSD-3-Clause
"""Wheels that slip as tyres do."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from bullet_sim.slipping_wheels import Slip
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.urdf_extras import unscoped
from loop_ros.reconfigure import Setting, SettingsServer
from urdf_model import Cylinder, Sphere

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

_LATERAL, _LONGITUDINAL = ("slip_compliance_unitless_" + axis for axis in ("lateral", "longitudinal"))
# Of the settings: a negative one changes nothing.
_AS_IT_IS, _MOST = -1.0, 1e3


class WheelSlip(ModelPlugin):
    """``libWheelSlipPlugin.so``, ``libgazebo_ros_wheel_slip.so``: each ``<wheel link_name="...">`` slips.

    ``slip_compliance_lateral`` and ``slip_compliance_longitudinal`` (0): the slip, in parts of the speed of the tread,
    for a force as large as ``wheel_normal_force`` [N]; ``wheel_radius`` [m], by default that of the wheel's shape. Both
    compliances can be set for all wheels by dynamic_reconfigure, in the namespace ``MODEL/wheel_slip``.
    """

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        wheels = [wheel for wheel in map(self._wheel, context.element.iterfind("wheel")) if wheel is not None]
        if not wheels:
            raise PluginError("%s: there is no <wheel link_name=\"...\"> that it can let slip" % self._what)
        own = (context.element.findtext("robotNamespace") or "").strip("/ \n") or "wheel_slip"
        SettingsServer(context, "/%s/%s" % (context.model.name, own), [
            Setting(_LATERAL, _AS_IT_IS, _AS_IT_IS, _MOST, "slip along the axle for a force like the load"),
            Setting(_LONGITUDINAL, _AS_IT_IS, _AS_IT_IS, _MOST, "slip across the axle for a force like the load"),
        ], self._set)
        # Last, so that a model whose name is none in ROS keeps its friction.
        self._slipping = context.world.let_slip(context.model, wheels)

    def _wheel(self, element: Any) -> Slip | None:
        """The Slip of a <wheel>, None where it cannot slip, which is named."""
        model = self.context.model
        link = unscoped(model.name, element.get("link_name") or "")
        joints = {joint.child: joint for joint in model.merged.joints.values()}
        turned = [name for name, joint in joints.items() if joint.type != "prismatic"]
        if link not in turned:
            self._leave_out(link, "no joint turns such a link; links of wheels are %s" % (", ".join(turned) or "none"))
            return None
        numbers = {}
        for tag, default in (("slip_compliance_lateral", 0.0), ("slip_compliance_longitudinal", 0.0),
                             ("wheel_normal_force", 0.0), ("wheel_radius", 0.0)):
            text = (element.findtext(tag) or "").strip()
            try:
                numbers[tag] = float(text) if text else default
            except ValueError:
                numbers[tag] = math.nan
            if not (math.isfinite(numbers[tag]) and numbers[tag] >= 0.0):
                self._leave_out(link, "<%s> is '%s', expected a number, 0 or more" % (tag, text))
                return None
        lateral, longitudinal, load, radius = numbers.values()
        if not radius:
            radius = max((shape.geometry.radius for shape in model.merged.links[link].collisions
                          if isinstance(shape.geometry, Cylinder | Sphere)), default=0.0)
        for tag, value in (("wheel_normal_force", load), ("wheel_radius", radius)):
            if not value:
                self._leave_out(link, "it has no <%s> above 0" % tag)
                return None
        return Slip(link, radius, load, lateral, longitudinal)

    def _leave_out(self, link: str, why: str) -> None:
        self.context.log.warn("%s: wheel '%s' does not slip: %s" % (self._what, link, why))

    def _set(self, values: dict[str, float]) -> None:
        for wheel in self._slipping.wheels:
            if values[_LATERAL] >= 0.0:
                wheel.lateral = values[_LATERAL]
            if values[_LONGITUDINAL] >= 0.0:
                wheel.longitudinal = values[_LONGITUDINAL]

    def close(self) -> None:
        self.context.world.end_slip(self._slipping)
