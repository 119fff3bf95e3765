# SPDX-License-Identifier: BSD-3-Clause
"""The <gazebo reference="..."> blocks of a URDF. Several blocks for a link or joint add up; a later element replaces an
earlier one of its name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from . import bounds
from .element_table import content
from .gazebo_names import gazebo_links, in_gazebos_order
from .materials import GLOWS, MATERIALS
from .model import ALL_BITS, MAY_BE_INFINITE, Finish, Joint, Link, Robot, Surface, is_true, with_both_frictions

# Element -> field of Surface. Both spellings of the first one are in use.
_SURFACE = {"mu": "friction", "mu1": "friction", "mu2": "friction_across", "kp": "stiffness", "kd": "damping",
            "maxVel": "leaving_speed", "max_vel": "leaving_speed"}


def apply_blocks(robot: Robot, warn: Callable[[Any, str], None]) -> None:
    """Apply the <gazebo> elements of a robot to its links and joints, in Gazebo's order where it lumps links together.

    ``warn(element, text)`` is called for numbers that cannot be used; they are left out.
    """
    of_links: dict[str, list[Any]] = {}
    for element in robot.gazebo:
        reference = element.get("reference")
        if not reference:  # links may say otherwise
            for part in element.iterchildren("self_collide"):
                for link in robot.links.values():
                    link.self_collide = is_true(part.text)
        elif reference in robot.links:
            of_links.setdefault(reference, []).append(element)
        elif reference in robot.joints:
            _read_joint_block(element, robot.joints[reference], warn)
    wholes = gazebo_links(robot)
    for name in in_gazebos_order(robot):
        for element in of_links.get(name, ()):
            _read_link_block(element, robot.links[name], robot.links[wholes.get(name, name)], warn)


def _read_link_block(element: Any, link: Link, whole: Link, warn: Callable[[Any, str], None]) -> None:
    """Apply a block that refers to ``link``: its surface and colour, and what Gazebo has for a whole link (weight,
    self-collision, decay of the speed) to ``whole``, the link that it lumps ``link`` into."""
    found = {}
    for tag, field in _SURFACE.items():
        # Also as SDF has them, in <collision>.
        for part in (*element.iterchildren(tag), *element.iterfind("collision/surface/*/ode/" + tag)):
            value = _of_surface(part, field, link.name, warn)
            if value is not None:
                found[field] = value
    for part in (*element.iterchildren("fdir1"), *element.iterfind("collision/surface/friction/ode/fdir1")):
        found["direction"] = _direction(part, link, warn)
    for part in element.iterfind("collision/surface/contact/collide_bitmask"):
        try:
            found["bitmask"] = int((part.text or "").strip(), 0) & ALL_BITS
        except ValueError:
            warn(part, "<collide_bitmask> of link '%s' is '%s', which is no number, and is left out"
                 % (link.name, part.text))
    if found:
        link.surface = with_both_frictions(replace(link.surface or Surface(), **found))
    for part in element.iterchildren("dampingFactor"):
        value = _number(part, "link '%s'" % link.name, False, warn)
        if value is not None:
            share = _within(part, "link '%s'" % link.name, value, 1.0, warn)
            whole.decay = (share, share)
    for part in element.iterchildren("selfCollide", "self_collide"):
        whole.self_collide = is_true(content(part))
    for part in element.iterchildren("turnGravityOff", "gravity"):
        whole.gravity = _has_weight(part)
    name = next((content(part) for part in element.iterchildren("material")), "")
    finish = Finish(emission=GLOWS[name]) if name in GLOWS else None
    for shape in link.visuals:
        shape.colour = shape.colour or MATERIALS.get(name)
        shape.finish = shape.finish or finish


def _read_joint_block(element: Any, joint: Joint, warn: Callable[[Any, str], None]) -> None:
    what = "joint '%s'" % joint.name
    for part in element.iterchildren("implicitSpringDamper", "cfmDamping"):
        joint.implicit_damping = is_true(content(part))
    for part in element.iterchildren("preserveFixedJoint", "disableFixedJointLumping"):
        joint.preserved = is_true(content(part))
    for part in element.iterchildren("springStiffness"):
        value = _number(part, what, False, warn)
        if value is not None:  # Gazebo takes a negative stiffness for one that it may reduce
            joint.spring_stiffness = abs(_within(part, what, value, bounds.DAMPING.high, warn, -bounds.DAMPING.high))
    for part in element.iterchildren("springReference"):
        value = _number(part, what, False, warn)
        if value is not None:
            joint.spring_reference = _within(part, what, value, bounds.POSITION.high, warn, bounds.POSITION.low)


def _of_surface(part, field, link, warn):
    """The number in an element of a surface; None where there is none that means something."""
    what = "link '%s'" % link
    value = _number(part, what, field in MAY_BE_INFINITE, warn)
    if value is None:
        return None
    if field.startswith("friction"):
        return math.inf if value < 0.0 else value  # as Gazebo takes it
    return _within(part, what, value, math.inf if field in MAY_BE_INFINITE else bounds.DAMPING.high, warn)


def _direction(part, link, warn):
    """The unit direction in an <fdir1>, which is in the axes of the link's first collision, in those of the link; None
    for 0 0 0."""
    try:
        values = np.array([float(word) for word in content(part).split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != 3 or not np.isfinite(values).all():
        warn(part, "<fdir1> of link '%s' is '%s', expected three numbers, and is left out" % (link.name, content(part)))
        return None
    length = np.linalg.norm(values)
    if length == 0.0:
        return None
    turn = link.collisions[0].origin[:3, :3] if link.collisions else np.eye(3)
    return tuple((turn @ values / length).tolist())


def _number(part, what, may_be_infinite, warn):
    """The number in an element about ``what``, or None, with a warning."""
    text = content(part)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value) or math.isinf(value) and not may_be_infinite:
        warn(part, "<%s> of %s is '%s', which is no number, and is left out" % (part.tag, what, text))
        return None
    return value


def _within(part, what, value, high, warn, low=0.0):
    used = min(max(value, low), high)
    if used != value:
        warn(part, "<%s> of %s is %g; %g is used" % (part.tag, what, value, used))
    return used


def _has_weight(part):
    """Whether a link has weight by this element, whose texts are those of Gazebo's readers."""
    text = content(part).lower()
    return text in ("false", "no", "0") if part.tag == "turnGravityOff" else text not in ("false", "0")
