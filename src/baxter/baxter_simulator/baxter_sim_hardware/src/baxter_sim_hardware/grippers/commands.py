# SPDX-License-Identifier: BSD-3-Clause
"""Command handling of all kinds of gripper: check a message, echo it, pass it on."""

from __future__ import annotations

import math
from typing import Any, TypeGuard

from baxter_model.readiness import NOT_ENABLED
from baxter_sim_hardware.arms.hand_load import read_load
from baxter_sim_hardware.errors import CommandRefused
from rospy_nodes.json_object import JsonRefused, read_object

#: Longest name of a sender, which is part of every state message [characters].
LONGEST_SENDER = 1000


class GripperHardware:
    """Commands and parameters of one kind of gripper. Kinds derive from it and fill the two tables.

    Attributes: command, sender, sequence: of the last valid command, as its acknowledgement;
    parameters: {name: value}; flags: {flag of the state message: whether it is set}, details: the JSON text in it;
    load: `arms.hand_load.HandLoad` that a client has told of, or None.
    """

    flags = {}
    details = ""

    PARAMETERS = {}  # {name: (value at the start, largest one)}; the smallest is 0
    COMMANDS = {}  # {command: (name of the method that takes the arguments as a dict, whether it needs power)}
    ONCE = ()  # commands that count once, however often the same message comes

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """As at the start: no command, parameters at their defaults."""
        self.load = None
        self.command, self.sender, self.sequence = "", "", 0
        self.parameters = {name: start for name, (start, _) in self.PARAMETERS.items()}

    def take(self, command: str, args: str, sender: str, sequence: int, enabled: bool) -> None:
        """One command message.

        args: JSON object (see rospy_nodes.json_object) or empty. sender, sequence: a client's mark; commands of ONCE
        with the same mark are repetitions of one command, which the SDK sends until it sees the effect. Raises
        CommandRefused for an unknown command, for invalid arguments, and for commands that need power while the robot
        is not enabled.
        """
        if command not in self.COMMANDS:
            raise CommandRefused("unknown gripper command '%.100s'; choices are %s" % (
                command, ", ".join(self.COMMANDS)))
        if len(sender) > LONGEST_SENDER:
            raise CommandRefused("sender has %d characters; it may have %d" % (len(sender), LONGEST_SENDER))
        method, needs_power = self.COMMANDS[command]
        is_repeated = sender and (command, sender, sequence) == (self.command, self.sender, self.sequence)
        self.command, self.sender, self.sequence = command, sender, sequence
        if is_repeated and command in self.ONCE:
            return
        try:
            values = read_object(args)
        except JsonRefused as error:
            raise CommandRefused("args must be a JSON object: %s" % error) from None
        if needs_power and not enabled:
            raise CommandRefused(NOT_ENABLED)
        getattr(self, method)(values)

    def no_op(self, values: dict[str, Any]) -> None:
        """Do nothing; the command is still acknowledged."""

    def configure(self, values: dict[str, Any]) -> None:
        """Change all parameters in `values`, or none if one is invalid; `urdf` among them tells the weight on the hand
        (see `arms.hand_load.read_load`). Raises CommandRefused."""
        values = dict(values)
        load = read_load(values.pop("urdf")) if "urdf" in values else self.load
        for name, value in values.items():
            if name not in self.PARAMETERS or not (is_number(value) and 0.0 <= value <= self.PARAMETERS[name][1]):
                raise CommandRefused("%s: %s is %r; parameters are %s" % (self.command, name, value, ", ".join(
                    "%s (0 to %g)" % (known, upper) for known, (_, upper) in self.PARAMETERS.items()) or "none"))
        self.parameters.update(values)
        self.load = load


class CustomGripperHardware(GripperHardware):
    """A tool that the robot knows nothing about, or none at all: without parameters, and no command has an effect."""

    COMMANDS = {"no_op": ("no_op", False), "set": ("configure", False), "configure": ("configure", False)}


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value from JSON is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
