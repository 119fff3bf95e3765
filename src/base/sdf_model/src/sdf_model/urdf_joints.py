# SPDX-License-Identifier: BSD-3-Clause
"""Joints of SDF in the <gazebo> elements of a URDF: they close loops, which a URDF's tree cannot have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Loop, Robot
from urdf_model.transforms import inverse, pose_matrix

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from lxml import etree

_KINDS = ("revolute", "continuous", "prismatic", "fixed", "ball")


def add_loops(robot: Robot) -> None:
    """Add a Loop for each ``<gazebo><joint>`` to a ``urdf_model.Robot``; what has no effect is in its warnings.

    ``<pose>`` is in the child's frame, ``<axis><xyz>`` in the joint's, or in the model's with
    ``use_parent_model_frame``.
    """
    elements = [joint for gazebo in robot.gazebo for joint in gazebo.findall("joint")]
    places = _places(robot) if elements else {}
    for element in elements:
        try:
            robot.loops.append(_loop(element, places))
        except ValueError as error:
            what = "is left out: %s" % error
        else:
            what = "closes a loop; it has no limits, dynamics and state"
        robot.warnings.append("line %d: <joint> '%s' in a <gazebo> %s"
                              % (element.sourceline, element.get("name", ""), what))


def _loop(element: etree._Element, places: Mapping[str, np.ndarray]) -> Loop:
    kind = element.get("type", "")
    parent, child = ((element.findtext(role) or "").strip() for role in ("parent", "child"))
    if kind not in _KINDS:
        raise ValueError("its type is '%s', expected one of %s" % (kind, ", ".join(_KINDS)))
    if parent not in places or child not in places or parent == child:
        raise ValueError("it joins '%s' and '%s', expected two of the links %s" % (parent, child, ", ".join(places)))
    pose = _numbers(element, "pose", 6, (0.0,) * 6)
    in_child = pose_matrix(pose[:3], pose[3:])
    frame = places[child] @ in_child
    axis = np.array(_numbers(element, "axis/xyz", 3, (0.0, 0.0, 1.0)))
    if (element.findtext("axis/use_parent_model_frame") or "").strip().lower() in ("1", "true"):
        axis = frame[:3, :3].T @ axis
    length = np.linalg.norm(axis)
    if length < 1e-9:
        raise ValueError("its axis is zero, expected a direction such as 0 0 1")
    return Loop(element.get("name", ""), kind, parent, child, inverse(places[parent]) @ frame, in_child, axis / length)


def _numbers(element: etree._Element, path: str, count: int, default: Sequence[float]) -> list[float]:
    text = (element.findtext(path) or "").strip()
    try:
        values = [float(word) for word in text.split()] or list(default)
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError("<%s> is '%s', expected %d numbers" % (path, text, count))
    return values


def _places(robot: Robot) -> dict[str, np.ndarray]:
    """{link: its frame (4, 4) in the model's, with all joints at 0}."""
    found, waiting = {robot.root: robot.root_origin}, [robot.root]
    while waiting:
        link = waiting.pop()
        for joint in robot.children(link):
            found[joint.child] = found[link] @ joint.origin @ joint.child_offset
            waiting.append(joint.child)
    return found
