# SPDX-License-Identifier: BSD-3-Clause
"""Reads which joints of a description can be controlled and how: <transmission> and <safety_controller>. ROS-free."""
from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from lxml import etree

from command_line.options import counted

from .errors import HardwareError
from .interfaces import EFFORT, POS_VEL, POS_VEL_ACC, POSITION, VELOCITY
from .limits import SoftLimits

_INTERFACES = {
    "hardware_interface/PositionJointInterface": POSITION,
    "hardware_interface/VelocityJointInterface": VELOCITY,
    "hardware_interface/EffortJointInterface": EFFORT,
    "hardware_interface/PosVelJointInterface": POS_VEL,
    "hardware_interface/PosVelAccJointInterface": POS_VEL_ACC,
}
_DEPRECATED = {name.split("/")[1]: name for name in _INTERFACES}
_SIMPLE = "transmission_interface/SimpleTransmission"
# Of two actuators and two joints, both of which take commands.
_OF_TWO = ("transmission_interface/DifferentialTransmission", "transmission_interface/FourBarLinkageTransmission")


@dataclass(frozen=True)
class ControlledJoint:
    """A joint with a transmission. ``reduction`` and ``offset`` [rad or m] have no effect here: as in Gazebo, commands
    and measurements are those of the joint, not of its actuator."""

    name: str
    interface: str
    reduction: float = 1.0
    offset: float = 0.0


def read_transmissions(urdf_xml: str | bytes, known_joints: Collection[str]) -> tuple[list[ControlledJoint], list[str]]:
    """Return (list of :class:`ControlledJoint`, list of warnings), in the order of the document.

    A transmission is left out with a warning if it lacks a part, if its hardware interface is not known, if its joint
    is not in ``known_joints``, or if its joint already has one; the others count. Several may share a name. Raises
    :class:`HardwareError` for a description that is not XML.
    """
    joints: dict[str, ControlledJoint] = {}
    warnings = _Warnings()
    for element in _root(urdf_xml).iterchildren("transmission"):
        where = _where(element)
        for found in _transmission(element, where, warnings):
            if found.name not in known_joints:
                warnings.add("%s for joint '%s'" % (where, found.name), "left out, since the model does not have these "
                             "joints or they do not move; its joints are %s" % ", ".join(known_joints))
            elif found.name in joints:
                warnings.add("%s for joint '%s'" % (where, found.name),
                             "left out, since these joints already have a transmission")
            else:
                joints[found.name] = found
    return list(joints.values()), warnings.lines()


class _Warnings:
    """Warnings, one line for all transmissions with the same one: a robot may have three for each of its joints."""

    def __init__(self) -> None:
        self._places: dict[str, list[str]] = {}  # text -> where

    def add(self, where: str, text: str) -> None:
        self._places.setdefault(text, []).append(where)

    def lines(self) -> list[str]:
        return ["%s: %s" % (", ".join(places), text) for text, places in self._places.items()]


def read_soft_limits(urdf_xml: str | bytes) -> dict[str, SoftLimits]:
    """{joint name: :class:`SoftLimits`} of the joints with a <safety_controller>. Raises :class:`HardwareError`.

    ``soft_lower_limit``, ``soft_upper_limit`` and ``k_position`` default to 0 as in the URDF specification;
    ``k_velocity`` is required.
    """
    found = {}
    for joint in _root(urdf_xml).iterchildren("joint"):
        safety = joint.find("safety_controller")
        if safety is None:
            continue
        values = {}
        for key, default in (("soft_lower_limit", 0.0), ("soft_upper_limit", 0.0), ("k_position", 0.0),
                             ("k_velocity", None)):
            text = safety.get(key)
            values[key] = default if text is None else _number(text)
            if values[key] is None:
                raise HardwareError("joint '%s', line %s: <safety_controller> has %s=%r, expected a number"
                                    % (joint.get("name"), safety.sourceline, key, text))
        found[joint.get("name")] = SoftLimits(values["soft_lower_limit"], values["soft_upper_limit"],
                                              values["k_position"], values["k_velocity"])
    return found


def _root(urdf_xml: str | bytes) -> Any:
    data = urdf_xml.encode() if isinstance(urdf_xml, str) else urdf_xml
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=False)
    try:
        return etree.fromstring(data.strip(), parser)
    except etree.XMLSyntaxError as error:
        raise HardwareError("the description is not well-formed XML: %s" % error) from error


def _where(element: Any) -> str:
    return "transmission '%s' (line %s)" % (element.get("name", ""), element.sourceline)


def _transmission(element: Any, where: str, warnings: _Warnings) -> list[ControlledJoint]:
    """The ControlledJoints of a transmission; none if it is left out."""
    kind = (element.findtext("type") or element.get("type") or "").strip()
    joints, actuators = element.findall("joint"), element.findall("actuator")
    missing = [part for part, there in (
        ("a name", element.get("name")), ("<type>", kind), ("a <joint> with a name", joints and joints[0].get("name")),
        ("an <actuator>", actuators)) if not there]
    if missing:
        warnings.add(where, "left out, since it lacks %s" % " and ".join(missing))
        return []
    if kind in _OF_TWO:
        used = [joint for joint in joints if joint.get("name")]
    else:
        used = joints[:1]
        if len(joints) > 1:
            warnings.add(where, "of %s only the first one, '%s', is used" % (
                counted(len(joints), "joint"), joints[0].get("name")))
    # A joint has the actuator at its place in the list; more joints than actuators share the last one.
    pairs = [(joint, actuators[min(number, len(actuators) - 1)]) for number, joint in enumerate(used)]
    controlled = [found for joint, actuator in pairs
                  if (found := _controlled(joint, actuator, where, warnings)) is not None]
    # One that is left out for its interface has had its line; how its type is taken would say the contrary.
    if controlled and kind not in (_SIMPLE, *_OF_TWO):
        warnings.add(where, "the type '%s' is not one of %s; it is taken as a SimpleTransmission"
                     % (kind, ", ".join((_SIMPLE, *_OF_TWO))))
    return controlled


def _controlled(joint: Any, actuator: Any, where: str, warnings: _Warnings) -> ControlledJoint | None:
    interface = _interface(joint, actuator, where, warnings)
    if interface is None:
        return None
    reduction = _figure(actuator, "mechanicalReduction", 1.0, where, warnings)
    if reduction == 0.0:
        warnings.add(where, "mechanicalReduction is 0, expected another number; it has no effect here")
    return ControlledJoint(joint.get("name"), interface, reduction, _figure(joint, "offset", 0.0, where, warnings))


def _interface(joint: Any, actuator: Any, where: str, warnings: _Warnings) -> str | None:
    names = [(found.text or "").strip() for found in joint.findall("hardwareInterface")]
    if not names:
        names = [(found.text or "").strip() for found in actuator.findall("hardwareInterface")]
        if not names:
            warnings.add(where, "left out, since its joint lacks <hardwareInterface>")
            return None
        warnings.add(where, "<hardwareInterface> belongs into <joint>, not into <actuator>")
    # An interface that is read only, such as JointStateInterface, may come first.
    name = next((name for name in names if _DEPRECATED.get(name, name) in _INTERFACES), names[0])
    if len(names) > 1:
        warnings.add(where, "of the hardware interfaces %s only %s is used" % (", ".join(names), name))
    if name in _DEPRECATED:
        warnings.add(where, "hardware interface '%s' is an old name; write '%s'" % (name, _DEPRECATED[name]))
        name = _DEPRECATED[name]
    if name not in _INTERFACES:
        warnings.add("%s with '%s'" % (where, name), "left out, since their hardware interfaces are not known; known "
                     "are %s" % ", ".join(_INTERFACES))
        return None
    return _INTERFACES[name]


def _figure(element: Any, tag: str, default: float, where: str, warnings: _Warnings) -> float:
    text = element.findtext(tag)
    if text is None:
        return default
    number = _number(text)
    if number is None:
        warnings.add(where, "%s is '%s', expected a number; it has no effect here" % (tag, text.strip()))
        return default
    return number


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
