# SPDX-License-Identifier: BSD-3-Clause
"""Which <gazebo> elements of a URDF, and which elements of its plugins, have no effect here. ROS-free."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING

from gazebo_ros.plugin_elements import TABLES
from sdf_model import elements as sdf
from urdf_model.element_table import ElementTable, Idle, IdleElements

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from urdf_model import Robot

_STOPS = "the stops of joints are hard"
_NOT_IN_A_URDF = "this element of SDF is not read in a URDF"

#: The elements of <gazebo> blocks as sdformat's reader of URDF has them: of the whole model, of a link, of a joint.
KNOWN = {
    "model": "static self_collide joint plugin start_configuration",
    "link": "mu mu1 mu2 fdir1 kp kd maxVel selfCollide self_collide dampingFactor "
            "turnGravityOff gravity material sensor light plugin canonicalBody "
            "maxContacts",
    "link/visual": "plugin",
    "link/collision": "max_contacts",
    "link/collision/surface/friction/ode": "mu mu2 fdir1",
    "link/collision/surface/contact": "collide_bitmask",
    "link/collision/surface/contact/ode": "kp kd max_vel",
    **{"link/collision/" + path: names for path, names in sdf.HARMLESS.items() if path.startswith("surface")},
    "joint": "implicitSpringDamper cfmDamping springStiffness springReference provideFeedback sensor plugin "
             "preserveFixedJoint disableFixedJointLumping",
}
WITHOUT_EFFECT: tuple[tuple[str, Mapping[str, str | None], str], ...] = (
    ("link", {"minDepth": sdf.KEPT_DEPTH}, sdf.WHOLE_DEPTH),
    ("link", {"laserRetro": "0"}, "intensities of lasers are 0"),
    ("link", {"kinematic": "false"}, "links move freely"),
    ("link/visual", dict.fromkeys(("pose", "geometry", "material", "transparency", "laser_retro", "cast_shadows",
                                   "visibility_flags", "meta")), _NOT_IN_A_URDF),
    ("link/collision", {"laser_retro": "0"}, "intensities of lasers are 0"),
    *(("link/collision/" + path, names, reason) for path, names, reason in sdf.WITHOUT_EFFECT
      if path.startswith("surface")),
    ("joint", {"stopCfm": "0", "stopErp": "0.2"}, _STOPS),
    ("joint", {"fudgeFactor": "0"}, "the solver is Bullet's, not ODE's"),
)
URDF = ElementTable([KNOWN], WITHOUT_EFFECT, numbers=("link/maxContacts", "link/collision/max_contacts"))


def idle_elements(robot: Robot, source: str) -> str:
    """One line that names what has an effect in Gazebo and none here in the <gazebo> elements of a
    ``urdf_model.Robot``, and what is not known there; "" for nothing. ``source`` names the description."""
    found = IdleElements()
    for gazebo in robot.gazebo:
        reference = gazebo.get("reference") or ""
        kind = "link" if reference in robot.links else "joint" if reference in robot.joints else "model"
        if reference and kind == "model":
            said = 'gazebo reference="%s"' % reference
            found.add(Idle(said, gazebo.sourceline, "neither a link nor a joint", False), source)
            continue
        for idle in URDF.find(gazebo, kind):
            if idle.unknown and "%s/%s" % (kind, idle.tag) in sdf.TABLE.rows:
                idle = idle._replace(reason=_NOT_IN_A_URDF, unknown=False)
            found.add(idle, source)
        for sensor in gazebo.iterchildren("sensor"):
            _add_all(found, sdf.TABLE.find(sensor, "sensor"), source)
    _add_plugins(found, robot, source)
    return found.text()


def plugin_elements(robots: Iterable[Robot], source: str) -> str:
    """As :func:`idle_elements`, of the plugins of several robots: for an SDF, whose other elements its reader names."""
    found = IdleElements()
    for robot in robots:
        _add_plugins(found, robot, source)
    return found.text()


def _add_plugins(found: IdleElements, robot: Robot, source: str) -> None:
    for gazebo in robot.gazebo:
        for plugin in gazebo.iter("plugin"):
            table = TABLES.get(os.path.basename(plugin.get("filename") or ""))
            if table is not None:
                _add_all(found, table.find(plugin, "plugin"), source)


def _add_all(found: IdleElements, idles: Iterable[Idle], source: str) -> None:
    for idle in idles:
        found.add(idle, source)
