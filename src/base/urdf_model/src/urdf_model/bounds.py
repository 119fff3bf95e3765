# SPDX-License-Identifier: BSD-3-Clause
"""The largest and smallest numbers that a description, a service or a world file may bring into the world.

Bullet computes in double precision and checks nothing: 1e308 N makes every position a NaN, and once its search tree of
boxes holds a NaN nothing in the world collides any more. The bounds are wide: each is beyond what any robot, building
or vehicle has, and far within the range of the arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from .model import Robot


Numbers = TypeVar("Numbers", bound=float | Sequence[float] | np.ndarray)


class OutOfBounds(ValueError):
    """A number is out of bounds: the text names it and its bound."""


@dataclass(frozen=True)
class Bound:
    """From ``low`` to ``high`` [``unit``]; ``reason`` says where the numbers come from."""

    low: float
    high: float
    unit: str
    reason: str

    def check(self, values: Numbers, what: str) -> Numbers:
        """Return ``values`` (a number or a sequence of numbers) if each is finite and within the bound.

        ``what`` names them in the text of OutOfBounds.
        """
        numbers = (values,) if isinstance(values, (int, float, np.number)) else values
        for number in numbers:
            # Also true for NaN, because it compares as false.
            if not self.low <= number <= self.high:
                found = "%g" % number if number is values else "(%s)" % ", ".join("%g" % value for value in numbers)
                raise OutOfBounds("%s is %s%s; expected %s" % (what, found, self._unit, self.text))
        return values

    @property
    def text(self) -> str:
        """The range in words, with the unit."""
        return "%g to %g%s" % (self.low, self.high, self._unit)

    @property
    def _unit(self):
        return " " + self.unit if self.unit else ""


def _either_way(largest, unit, reason):
    return Bound(-largest, largest, unit, reason)


LENGTH = Bound(1e-9, 1e4, "m", "sides and radii of shapes: from dummy links of sensors to an airfield; more is a plane")
POSITION = _either_way(1e7, "m", "holds map coordinates (UTM northings end at 1e7 m); doubles resolve 2 nm there")
JOINT_POSITION = _either_way(1e6, "rad or m", "160000 turns of a wheel; doubles resolve 0.1 nrad there")
SPEED = _either_way(1e4, "m/s", "above escape velocity of the Moon; 20 m in a tick. Bullet itself goes on at 100 m/s")
TURN_RATE = _either_way(1e4, "rad/s", "95000 revolutions per minute. Bullet itself goes on at 100 rad/s")
FORCE = _either_way(1e7, "N", "the weight of 1000 t")
TORQUE = _either_way(1e7, "N m", "the largest wind turbines' rotors")
EFFORT = _either_way(1e7, "N or N m", "of a joint: as for forces and torques")
DAMPING = Bound(0.0, 1e12, "N s/m or N m s/rad", "of joints and contacts: holds a joint fast already")
FRICTION = Bound(0.0, 1e9, "N or N m", "of a joint: more than any effort overcomes")
MASS = Bound(0.0, 1e7, "kg", "10000 t. Bullet solves ratios of masses up to some 1e10 in doubles")
#: Less than a microgram is not a mass: its inverse times a force overflows a double.
MIN_MASS_KG = 1e-9
#: A moving body needs some inertia, or the solver divides by zero: for its mass that of a ball of 1.6 mm radius
#: (0.4 m r^2), smaller than any part of a robot.
MIN_INERTIA_PER_MASS_M2 = 1e-6
INERTIA = _either_way(1e12, "kg m^2", "the largest mass on an arm of 300 m")
SCALE = _either_way(1e6, "", "of a mesh: files in micrometres are the smallest in use")
GRAVITY = _either_way(1e3, "m/s^2", "four times that of the Sun's surface")
TIME_STEP = Bound(1e-5, 0.05, "s", "shorter ones cannot run in real time; with longer ones nothing stands still")
SOLVER_ITERATIONS = Bound(1, 1000, "", "more change nothing that can be measured, and stop the clock")
UPDATE_RATE = Bound(0.0, 1e6, "Hz", "no machine makes a step in a microsecond; 0 is as fast as possible")

#: A limit of a joint beyond this [rad, m, N, N m and per second] means none; SDF's own default is 1e16.
NO_LIMIT = 1e12

#: Limits of a description: ten times the largest robots in use. It is sent to every viewer.
DESCRIPTION_BYTES = 4_000_000
#: Limits of a world file, of which each model is read once.
WORLD_BYTES = 40_000_000
#: Elements that are shorter than this on average hold no data.
BYTES_PER_ELEMENT = 40
LINKS = 2_000  # about 0.2 s to read
INCLUDES = 2_000
#: Bullet's buffers hold 128 coordinates for a body (MAX_DEGREE_OF_FREEDOM), of which seven are its base's.
MOVABLE_JOINTS = 121
NAME_LETTERS = 500


def check_robot(robot: Robot) -> None:
    """Check all numbers of a Robot, and its size. Raises OutOfBounds, with names and line numbers."""
    if len(robot.links) > LINKS:
        raise OutOfBounds("%d links are more than can be read in time; expected at most %d" % (len(robot.links), LINKS))
    movable = len(robot.movable_joints())
    if movable > MOVABLE_JOINTS:
        raise OutOfBounds(
            "%d joints that move are more than Bullet has room for in one body; expected at most %d"
            % (movable, MOVABLE_JOINTS)
        )
    _check_place(robot.root_origin, "the pose of the root link")
    for link in robot.links.values():
        _check_link(link)
    for joint in robot.joints.values():
        _check_joint(joint)


def check_name(name: str, what: str) -> str:
    """Return ``name``; raises OutOfBounds if it is too long to be published at every tick."""
    if len(name) > NAME_LETTERS:
        raise OutOfBounds("%s has %d letters ('%s…'); expected at most %d" % (what, len(name), name[:40], NAME_LETTERS))
    return name


def _check_link(link):
    check_name(link.name, "the name of a link")
    where = "link '%s'%s" % (link.name, _line(link))
    if link.inertial is not None:
        MASS.check(link.inertial.mass, "the mass of %s" % where)
        POSITION.check(link.inertial.centre, "the centre of mass of %s" % where)
        INERTIA.check(link.inertial.inertia.ravel(), "the inertia of %s" % where)
    for kind, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        for shape in shapes:
            _check_shape(shape, "%s of %s" % (kind, where))
    if link.surface is not None and link.surface.damping is not None:
        DAMPING.check(link.surface.damping, "the contact damping of %s" % where)


def _check_shape(shape, where):
    _check_place(shape.origin, "the origin of a %s" % where)
    kind = type(shape.geometry).__name__.lower()
    for field, value in vars(shape.geometry).items():
        if field == "scale":
            SCALE.check(value, "the scale of the mesh in a %s" % where)
        elif field not in ("filename", "submesh", "centred"):
            LENGTH.check(value, "the %s of the %s in a %s" % (field, kind, where))


def _check_joint(joint):
    check_name(joint.name, "the name of a joint")
    where = "joint '%s'%s" % (joint.name, _line(joint))
    _check_place(joint.origin, "the origin of %s" % where)
    _check_place(joint.child_offset, "the place of the child of %s" % where)
    if not abs(np.dot(joint.axis, joint.axis) - 1.0) < 1e-6:
        raise OutOfBounds("the axis of %s is %s; expected a direction such as 0 0 1" % (where, joint.axis))
    DAMPING.check(joint.damping, "the damping of %s" % where)
    FRICTION.check(joint.friction, "the friction of %s" % where)
    DAMPING.check(joint.spring_stiffness, "the stiffness of the spring of %s" % where)
    POSITION.check(joint.spring_reference, "the reference of the spring of %s" % where)
    for field in ("lower", "upper", "velocity", "effort"):
        value = getattr(joint.limit, field)
        if value is not None and not abs(value) <= NO_LIMIT:
            raise OutOfBounds("the %s limit of %s is %g; expected at most %g" % (field, where, value, NO_LIMIT))


def _check_place(matrix, what):
    POSITION.check(matrix[:3, 3], what)
    if not np.isfinite(matrix).all():
        raise OutOfBounds("%s has a rotation that is not finite" % what)


def _line(element):
    return " (line %d)" % element.line if element.line else ""

