# SPDX-License-Identifier: BSD-3-Clause
"""One robot among many: how the robot with a serial number differs from the drawing.

Robot 0 is the drawing. Every difference follows from the serial number and the name of the part, so a robot is the same
on every machine, with or without its other parts.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

import numpy as np

from baxter_model import SIDES

from . import effects
from .errors import BaxterHardwareError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from sensor_renderer.pinhole import Pinhole

#: Differences are normally distributed, and cut off at so many standard deviations: parts pass an inspection.
CUT_OFF = 2.0
DRAWING = 0
_AXES = ("x", "y", "z")
_MOUNTS = tuple("%s_torso_arm_mount" % side for side in SIDES)
#: {fixed joint: the numbers that its difference comes from}
PLACED = {
    **dict.fromkeys(_MOUNTS, "mount"),
    **dict.fromkeys(("head_camera", *("%s_hand_camera" % side for side in SIDES)), "camera"),
    **dict.fromkeys(("%s_gripper_base" % side for side in SIDES), "gripper"),
}
#: Where a robot publishes what its factory has measured.
ROBOT_CONFIG = "/robot_config/jcb_urdf_config/torso_t0/joint/"
#: What a parameter of the master can hold (XML-RPC).
LARGEST_SERIAL = 2 ** 31 - 1


def is_file(serial: int | str) -> bool:
    """Whether `serial` names a file of numbers, as `./baxter.sh sysid` writes it, and no number."""
    return str(serial).endswith((".yaml", ".yml"))


def numbers_of(serial: int | str) -> str | Path:
    """Path of the numbers of the robot `serial`: its file, or those that all numbered robots have."""
    return str(serial) if is_file(serial) else effects.physical_robot()


def checked(serial: int | str) -> int:
    """A serial number as an integer; of a robot with a file of its own, that of the drawing.

    Raises BaxterHardwareError unless it is a YAML file or a whole number from 0 to LARGEST_SERIAL.
    """
    if is_file(serial):
        return DRAWING
    try:
        number = int(str(serial))
    except ValueError:
        number = -1
    if not 0 <= number <= LARGEST_SERIAL or isinstance(serial, bool):
        raise BaxterHardwareError("serial is %r; it must be a whole number, 0 (the drawing) to %d, or a YAML file" % (
            serial, LARGEST_SERIAL))
    return number


def difference(serial: int, part: str, rows: Mapping[str, Mapping[str, float]], number: str) -> dict[str, float]:
    """{name: value} by how much `part`, any text, of the robot `serial` differs; zeros for robot 0.

    rows: section "serial" of `effects.read`; number: a row of it, whose values are standard deviations. Raises
    BaxterHardwareError.
    """
    deviations = effects.row(rows, number)
    if serial == DRAWING:
        return dict.fromkeys(deviations, 0.0)
    values = np.clip(drawn(serial, part, number).standard_normal(len(deviations)), -CUT_OFF, CUT_OFF)
    return {name: float(deviations[name] * value) for name, value in zip(sorted(deviations), values, strict=True)}


def drawn(serial: int, part: str, number: str) -> np.random.Generator:
    """The random numbers of one property (`number`, any text) of `part` of the robot `serial`."""
    return np.random.default_rng([serial, zlib.crc32(("%s %s" % (part, number)).encode())])


def described(urdf_xml: str, serial: int, rows: Mapping[str, Mapping[str, float]]) -> str:
    """The description (URDF text) of the robot `serial`: mounts of arms, cameras and grippers are where its own are.

    rows: as for `difference`. Robot 0's is the text as given. Raises BaxterHardwareError for a text that is no XML.
    """
    if serial == DRAWING:
        return urdf_xml
    root = _parsed(urdf_xml)
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        kind = PLACED.get(name)
        if kind is None:
            continue
        origin = joint.find("origin")
        if origin is None:
            origin = ElementTree.SubElement(joint, "origin")
        for attribute, number in (("xyz", "position"), ("rpy", "orientation")):
            moved = difference(serial, name, rows, "%s_%s" % (kind, number))
            values = [float(word) for word in origin.get(attribute, "0 0 0").split()]
            origin.set(attribute, " ".join("%.7g" % (value + moved[axis])
                                           for value, axis in zip(values, _AXES, strict=True)))
    return ElementTree.tostring(root, encoding="unicode")


def robot_config(urdf_xml: str) -> dict[str, str]:
    """{parameter: text} of what the factory has measured: origins of the arms' mounts as the description has them.

    Raises BaxterHardwareError for a text that is no XML.
    """
    found = {}
    for joint in _parsed(urdf_xml).findall("joint"):
        if joint.get("name") in _MOUNTS:
            origin = joint.find("origin")
            for attribute in ("xyz", "rpy"):
                found["%s%s/origin/%s" % (ROBOT_CONFIG, joint.get("name"), attribute)] = (
                    "0 0 0" if origin is None else origin.get(attribute, "0 0 0"))
    return found


class LensFactors(NamedTuple):
    """How a camera's lens differs: factors of the focal lengths, shift of the principal point [pixels of the array]."""

    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def of(cls, serial: int, camera: str, rows: Mapping[str, Mapping[str, float]]) -> LensFactors:
        """The lens of `camera`, "left_hand_camera" for instance. Raises BaxterHardwareError."""
        focal = difference(serial, camera, rows, "focal_length")
        centre = difference(serial, camera, rows, "principal_point")
        both = 1.0 + focal["both"]
        return cls(both, both * (1.0 + focal["aspect"]), centre["x"], centre["y"])

    def before(self, pinhole: Pinhole, scale: float) -> Pinhole:
        """The pinhole (of sensor_renderer) behind this lens; scale: pixels of its picture for one of the array."""
        return pinhole._replace(fx=self.fx * pinhole.fx, fy=self.fy * pinhole.fy, cx=pinhole.cx + scale * self.cx,
                                cy=pinhole.cy + scale * self.cy)


def _parsed(urdf_xml: str) -> ElementTree.Element:
    try:
        return ElementTree.fromstring(urdf_xml)
    except ElementTree.ParseError as error:
        raise BaxterHardwareError("the robot's description is no XML: %s" % error) from error
