# SPDX-License-Identifier: BSD-3-Clause
"""Accepts fields that messages of ROS Kinetic had and those of Noetic lack, since programs of that time set them.

They are not sent, so neither MD5 nor wire changes. The first use of each is told in one line.
"""
import functools
import sys

# Class -> {field: what a program reads there}. Noetic's inverse kinematics searches until the time-out.
FIELDS = {"PositionIKRequest": {"attempts": 0}}


def amend(messages):
    """Make the message classes of a module take the fields that they had."""
    for class_name in FIELDS.keys() & vars(messages).keys():
        _accept(getattr(messages, class_name), FIELDS[class_name])


def _accept(message, fields):
    make, told = message.__init__, set()

    def tell(name):
        if name not in told:
            told.add(name)
            sys.stderr.write("%s.%s is a field of ROS Kinetic that this version does not have; it is ignored\n"
                             % (message.__name__, name))

    @functools.wraps(make)
    def init(self, *arguments, **values):
        for name in fields.keys() & values.keys():
            tell(name)
            del values[name]
        make(self, *arguments, **values)

    message.__init__ = init
    for name, value in fields.items():
        setattr(message, name, property(lambda _, value=value: value, lambda _, __, name=name: tell(name)))
