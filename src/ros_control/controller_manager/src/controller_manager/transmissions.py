# SPDX-License-Identifier: BSD-3-Clause
"""Reads which joints of a description can be controlled and how: <transmission> and <safety_controller>. ROS-free."""
import math
from dataclasses import dataclass

from lxml import etree

from .errors import HardwareError
from .interfaces import EFFORT, POSITION, VELOCITY
from .limits import SoftLimits

_INTERFACES = {
    "hardware_interface/PositionJointInterface": POSITION,
    "hardware_interface/VelocityJointInterface": VELOCITY,
    "hardware_interface/EffortJointInterface": EFFORT,
}
_DEPRECATED = {name.split("/")[1]: name for name in _INTERFACES}
_TYPES = tuple("transmission_interface/" + name for name in (
    "SimpleTransmission", "DifferentialTransmission", "FourBarLinkageTransmission"))


@dataclass(frozen=True)
class ControlledJoint:
    """A joint with a transmission. ``reduction`` and ``offset`` [rad or m] have no effect here: as in Gazebo, commands
    and measurements are those of the joint, not of its actuator."""

    name: str
    interface: str
    reduction: float = 1.0
    offset: float = 0.0


def read_transmissions(urdf_xml, known_joints):
    """Return (list of :class:`ControlledJoint`, list of warnings), in the order of the document.

    A transmission that lacks a part is left out with a warning; several may share a name. Raises
    :class:`HardwareError` for a hardware interface that does not exist and a joint that is not in ``known_joints``.
    """
    joints, warnings = {}, []
    for element in _root(urdf_xml).iterchildren("transmission"):
        found = _transmission(element, warnings)
        if found is None:
            continue
        if found.name not in known_joints:
            raise HardwareError("%s names joint '%s', which the model does not have or which does not move; its joints "
                                "are %s" % (_where(element), found.name, ", ".join(known_joints)))
        if found.name in joints:
            warnings.append("%s is left out: joint '%s' already has a transmission" % (_where(element), found.name))
            continue
        joints[found.name] = found
    return list(joints.values()), warnings


def read_soft_limits(urdf_xml):
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


def _root(urdf_xml):
    data = urdf_xml.encode() if isinstance(urdf_xml, str) else urdf_xml
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=False)
    try:
        return etree.fromstring(data.strip(), parser)
    except etree.XMLSyntaxError as error:
        raise HardwareError("the description is not well-formed XML: %s" % error) from error


def _where(element):
    return "transmission '%s' (line %s)" % (element.get("name", ""), element.sourceline)


def _transmission(element, warnings):
    where = _where(element)
    kind = (element.findtext("type") or element.get("type") or "").strip()
    joints, actuators = element.findall("joint"), element.findall("actuator")
    missing = [part for part, there in (
        ("a name", element.get("name")), ("<type>", kind), ("a <joint> with a name", joints and joints[0].get("name")),
        ("an <actuator>", actuators)) if not there]
    if missing:
        warnings.append("%s is left out: it lacks %s" % (where, " and ".join(missing)))
        return None
    if kind not in _TYPES:
        warnings.append("%s has the type '%s', expected one of %s; it is taken as a SimpleTransmission"
                        % (where, kind, ", ".join(_TYPES)))
    if len(joints) > 1:
        warnings.append("%s has %d joints; only the first one, '%s', is used"
                        % (where, len(joints), joints[0].get("name")))
    interface = _interface(joints[0], actuators[0], where, warnings)
    if interface is None:
        return None
    reduction = _figure(actuators[0], "mechanicalReduction", 1.0, where, warnings)
    if reduction == 0.0:
        warnings.append("%s: mechanicalReduction is 0, expected another number; it has no effect here" % where)
    return ControlledJoint(joints[0].get("name"), interface, reduction,
                           _figure(joints[0], "offset", 0.0, where, warnings))


def _interface(joint, actuator, where, warnings):
    names = [(found.text or "").strip() for found in joint.findall("hardwareInterface")]
    if not names:
        names = [(found.text or "").strip() for found in actuator.findall("hardwareInterface")]
        if not names:
            warnings.append("%s is left out: joint '%s' lacks <hardwareInterface>" % (where, joint.get("name")))
            return None
        warnings.append("%s: <hardwareInterface> belongs into <joint>, not into <actuator>" % where)
    if len(names) > 1:
        warnings.append("%s: only the first of the hardware interfaces %s is used" % (where, ", ".join(names)))
    name = names[0]
    if name in _DEPRECATED:
        warnings.append("%s: hardware interface '%s' is an old name; write '%s'" % (where, name, _DEPRECATED[name]))
        name = _DEPRECATED[name]
    if name not in _INTERFACES:
        raise HardwareError("%s has the hardware interface '%s'; known are %s" % (where, name, ", ".join(_INTERFACES)))
    return _INTERFACES[name]


def _figure(element, tag, default, where, warnings):
    text = element.findtext(tag)
    if text is None:
        return default
    number = _number(text)
    if number is None:
        warnings.append("%s: %s is '%s', expected a number; it has no effect here" % (where, tag, text.strip()))
        return default
    return number


def _number(text):
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
