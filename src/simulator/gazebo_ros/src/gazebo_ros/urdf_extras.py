# SPDX-License-Identifier: BSD-3-Clause
"""Reads the ``<gazebo>`` elements of a URDF. In an SDF they are our own extension. ROS-free."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from loop_ros.names import IllegalName, checked_name
from urdf_model.element_table import content

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from urdf_model import Robot

#: The element, inside <gazebo>, in which spawn_model hands over the joint positions of its option -J.
START_CONFIGURATION = "start_configuration"
_OF_JOINTS = "libgazebo_ros_ft_sensor.so"


class ExtrasError(Exception):
    """A <gazebo> element cannot be used; the text says which and what would be right."""


def plugins(robot: Robot) -> list[Any]:
    """The ``<plugin>`` elements of all ``<gazebo>`` elements that belong to the model, not to a sensor."""
    return [plugin for gazebo in robot.gazebo for plugin in gazebo.findall("plugin")]


def sensor_plugins(robot: Robot, warn: Callable[[str], object]) -> list[Any]:
    """The ``<plugin>`` elements of the ``<sensor>`` elements of links, and of those of joints that measure force.

    A sensor elsewhere is left out with its plugins, and ``warn(text)`` is called.
    """
    found = []
    for gazebo in robot.gazebo:
        for sensor in gazebo.findall("sensor"):
            link, inside = gazebo.get("reference"), sensor.findall("plugin")
            if link in robot.links:
                found += inside
            elif link in robot.joints and sensor.get("type") == "force_torque" and all(
                    (plugin.get("filename") or "").endswith(_OF_JOINTS) for plugin in inside):
                found += inside  # without a plugin it is hardware of a controller
            elif link in robot.joints:
                warn("sensor '%s' of '%s' is on a joint, '%s', and is left out; there, <sensor type=\"force_torque\"> "
                     "is served, without a plugin or with %s" % (sensor.get("name", ""), robot.name, link, _OF_JOINTS))
            else:
                warn("sensor '%s' is on link '%s', which '%s' does not have, and is left out; links: %s"
                     % (sensor.get("name", ""), link, robot.name, ", ".join(robot.links)))
    return found


def visual_plugins(robot: Robot) -> list[Any]:
    """The ``<plugin>`` elements of the ``<visual>`` elements of links."""
    return [plugin for gazebo in robot.gazebo if gazebo.get("reference") in robot.links
            for plugin in gazebo.findall("visual/plugin")]


def visual_of(plugin: Any) -> tuple[str | None, str | None]:
    """The link of a plugin in a ``<visual>``, None outside of one, and the visual's name, None in a URDF: there it is
    in all visuals of the link."""
    visual = plugin.getparent()
    if visual is None or visual.tag != "visual":
        return None, None
    return visual.getparent().get("reference"), visual.get("name")


def sensor_of(plugin: Any) -> tuple[Any, str] | tuple[None, None]:
    """The ``<sensor>`` that a plugin element stands in and the name of its link or joint; ``(None, None)`` outside of
    one."""
    sensor = plugin.getparent()
    if sensor is None or sensor.tag != "sensor":
        return None, None
    return sensor, sensor.getparent().get("reference")


def is_static(robot: Robot) -> bool | None:
    """True or None (not said): ``<gazebo><static>true</static></gazebo>`` fixes a model in the world."""
    said = [content(static).lower() for gazebo in robot.gazebo for static in gazebo.findall("static")]
    return True if "true" in said or "1" in said else None


def start_configuration(robot: Robot, warn: Callable[[str], object]) -> dict[str, float]:
    """Joint positions {name: rad or m} of the model at its start, from ``<gazebo><start_configuration>``.

    As in Gazebo, the last position of a joint counts, and unknown joints are passed over; ``warn(text)`` is called for
    those. Raises :class:`ExtrasError` for values that are not numbers.
    """
    known = [joint.name for joint in robot.movable_joints()]
    positions = {}
    for gazebo in robot.gazebo:
        for element in gazebo.findall("%s/joint" % START_CONFIGURATION):
            name, text = element.get("name"), element.text or ""
            if name not in known:
                warn("start configuration: joint '%s' is not a movable joint of '%s' and is passed over; joints: %s"
                     % (name, robot.name, ", ".join(known) or "none"))
                continue
            try:
                positions[name] = float(text)
            except ValueError:
                positions[name] = math.nan
            if not math.isfinite(positions[name]):
                raise ExtrasError("start configuration: joint '%s' is at '%s', expected a finite number" % (name, text))
    return positions


def unscoped(model_name: str, name: str) -> str:
    """The plain name of a joint or link, also if it is given as Gazebo scopes it, ``model::name``."""
    scope = model_name + "::"
    return name[len(scope):] if name.startswith(scope) else name


def with_start_configuration(xml: str, positions: Sequence[tuple[str, float]]) -> str:
    """The model description ``xml`` with a start configuration added. ``positions``: list of (name, value)."""
    if not positions:
        return xml
    joints = "".join('<joint name="%s">%r</joint>' % (_attribute(name), float(value)) for name, value in positions)
    block = "<gazebo><%s>%s</%s></gazebo>" % (START_CONFIGURATION, joints, START_CONFIGURATION)
    for end in ("</robot>", "</model>"):
        head, found, tail = xml.rpartition(end)
        if found:
            return head + block + end + tail
    raise ExtrasError("joint positions need a URDF or an SDF: the description has no </robot> and no </model>")


def namespace_of(plugin: Any, spawn_namespace: str | None) -> str:
    """The absolute namespace of a plugin: its own ``robotNamespace``, else the one it was spawned with.

    Raises :class:`ExtrasError` for a namespace that is none in ROS.
    """
    own = (plugin.findtext("robotNamespace") or "").strip()
    name = (own or spawn_namespace or "").strip("/")
    try:
        return checked_name("/" + name) if name else ""
    except IllegalName as error:
        raise ExtrasError("the namespace of plugin '%s', %s: %s" % (
            plugin.get("filename"), "its robotNamespace" if own else "robot_namespace of the request", error)) from None


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
