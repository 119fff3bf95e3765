# SPDX-License-Identifier: BSD-3-Clause
"""Accepts messages as ROS Kinetic had them, since programs of that time name fields that Noetic's lack, and give all
fields by position without those that Noetic's have gained.

Former fields are not sent, and gained ones have their defaults, so neither MD5 nor wire changes. The first use of each
is told in one line.
"""
from __future__ import annotations

import functools
import sys
from typing import Any

# Class -> {field: what a program reads there}; they were the last ones. Noetic's inverse kinematics searches until the
# time-out.
FIELDS = {"PositionIKRequest": {"attempts": 0}}
# Class -> fields that Kinetic's lacked. The others have kept their order.
GAINED = {
    "CollisionObject": {"pose", "subframe_names", "subframe_poses"},
    "DisplayRobotState": {"hide"},
    "GetCartesianPathRequest": {"prismatic_jump_threshold", "revolute_jump_threshold", "cartesian_speed_limited_link",
                                "max_cartesian_speed"},
    "GetPlannerParamsRequest": {"pipeline_id"},
    "MotionPlanRequest": {"reference_trajectories", "pipeline_id", "cartesian_speed_limited_link",
                          "max_cartesian_speed"},
    "OrientationConstraint": {"parameterization"},
    "PlaceLocation": {"quality"},
    "SetLightPropertiesRequest": {"cast_shadows", "specular", "direction", "pose"},
    "SetPlannerParamsRequest": {"pipeline_id"},
}


def amend(messages: Any) -> None:
    """Make the message classes of a module take what they took."""
    for class_name in (FIELDS.keys() | GAINED.keys()) & vars(messages).keys():
        _accept(getattr(messages, class_name), FIELDS.get(class_name, {}), GAINED.get(class_name, ()))


def _accept(message, fields, gained):
    make, told = message.__init__, set()
    former = [name for name in message.__slots__ if name not in gained] + list(fields)

    def tell(what, text):
        if what not in told:
            told.add(what)
            sys.stderr.write(text + "\n")

    def tell_of(name):
        tell(name, "%s.%s is a field of ROS Kinetic that this version does not have; it is ignored"
             % (message.__name__, name))

    @functools.wraps(make)
    def init(self, *arguments, **values):
        if arguments and not values and len(arguments) == len(former) != len(message.__slots__):
            if gained:
                tell(None, "%s: %d values by position are taken for the fields of ROS Kinetic: %s"
                     % (message.__name__, len(former), ", ".join(former)))
            arguments, values = (), dict(zip(former, arguments, strict=True))
        for name in fields.keys() & values.keys():
            tell_of(name)
            del values[name]
        make(self, *arguments, **values)

    message.__init__ = init
    for name, value in fields.items():
        setattr(message, name, property(lambda _, value=value: value, lambda _, __, name=name: tell_of(name)))
