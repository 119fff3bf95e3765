# SPDX-License-Identifier: BSD-3-Clause
"""Enable, disable, stop and reset as one transition table.

The wire fields of each state follow the physical robot: `ready` is true while enabled, a software stop shows an
unknown button and an unknown source, a released emergency stop stays stopped until it is reset, and a robot that
failed is stopped with an error whose source is a fault.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from baxter_model.readiness import NOT_ENABLED, RESET

from .errors import CommandRefused


class State(Enum):
    """The state of the whole robot."""

    DISABLED = "disabled"
    ENABLED = "enabled"
    STOPPED = "stopped by software"
    ESTOP_PRESSED = "emergency stop pressed"
    ESTOP_RELEASED = "emergency stop released, not yet reset"
    FAILED = "failed"


class Event(Enum):
    """Events of the robot. Listed in the order in which one tick applies them: a stop comes last."""

    RESET = "reset"
    DISABLE = "disable"
    ENABLE = "enable"
    ESTOP_RELEASE = "emergency stop released"
    STOP = "stop"
    ESTOP_PRESS = "emergency stop pressed"


class Button(IntEnum):
    """AssemblyState.estop_button on the wire."""

    UNPRESSED = 0
    PRESSED = 1
    UNKNOWN = 2
    RELEASED = 3


class Source(IntEnum):
    """AssemblyState.estop_source on the wire."""

    NONE = 0
    USER = 1
    UNKNOWN = 2
    FAULT = 3
    BRAIN = 4


@dataclass(frozen=True)
class Assembly:
    """The fields of one AssemblyState message."""

    ready: bool
    enabled: bool
    stopped: bool
    error: bool
    estop_button: Button
    estop_source: Source


ASSEMBLY = {
    State.DISABLED: Assembly(False, False, False, False, Button.UNPRESSED, Source.NONE),
    State.ENABLED: Assembly(True, True, False, False, Button.UNPRESSED, Source.NONE),
    State.STOPPED: Assembly(False, False, True, False, Button.UNKNOWN, Source.UNKNOWN),
    State.ESTOP_PRESSED: Assembly(False, False, True, False, Button.PRESSED, Source.USER),
    State.ESTOP_RELEASED: Assembly(False, False, True, False, Button.RELEASED, Source.USER),
    State.FAILED: Assembly(False, False, True, True, Button.UNPRESSED, Source.FAULT),
}

# Every (state, event) pair has its row. Reset always ends disabled: the SDK's reset() waits for exactly that.
TRANSITIONS = {
    (State.DISABLED, Event.ENABLE): State.ENABLED,
    (State.DISABLED, Event.DISABLE): State.DISABLED,
    (State.DISABLED, Event.STOP): State.STOPPED,
    (State.DISABLED, Event.RESET): State.DISABLED,
    (State.DISABLED, Event.ESTOP_PRESS): State.ESTOP_PRESSED,
    (State.DISABLED, Event.ESTOP_RELEASE): State.DISABLED,
    (State.ENABLED, Event.ENABLE): State.ENABLED,
    (State.ENABLED, Event.DISABLE): State.DISABLED,
    (State.ENABLED, Event.STOP): State.STOPPED,
    (State.ENABLED, Event.RESET): State.DISABLED,
    (State.ENABLED, Event.ESTOP_PRESS): State.ESTOP_PRESSED,
    (State.ENABLED, Event.ESTOP_RELEASE): State.ENABLED,
    (State.STOPPED, Event.ENABLE): State.STOPPED,
    (State.STOPPED, Event.DISABLE): State.STOPPED,
    (State.STOPPED, Event.STOP): State.STOPPED,
    (State.STOPPED, Event.RESET): State.DISABLED,
    (State.STOPPED, Event.ESTOP_PRESS): State.ESTOP_PRESSED,
    (State.STOPPED, Event.ESTOP_RELEASE): State.STOPPED,
    (State.ESTOP_PRESSED, Event.ENABLE): State.ESTOP_PRESSED,
    (State.ESTOP_PRESSED, Event.DISABLE): State.ESTOP_PRESSED,
    (State.ESTOP_PRESSED, Event.STOP): State.ESTOP_PRESSED,
    (State.ESTOP_PRESSED, Event.RESET): State.ESTOP_PRESSED,
    (State.ESTOP_PRESSED, Event.ESTOP_PRESS): State.ESTOP_PRESSED,
    (State.ESTOP_PRESSED, Event.ESTOP_RELEASE): State.ESTOP_RELEASED,
    (State.ESTOP_RELEASED, Event.ENABLE): State.ESTOP_RELEASED,
    (State.ESTOP_RELEASED, Event.DISABLE): State.ESTOP_RELEASED,
    (State.ESTOP_RELEASED, Event.STOP): State.ESTOP_RELEASED,
    (State.ESTOP_RELEASED, Event.RESET): State.DISABLED,
    (State.ESTOP_RELEASED, Event.ESTOP_PRESS): State.ESTOP_PRESSED,
    (State.ESTOP_RELEASED, Event.ESTOP_RELEASE): State.ESTOP_RELEASED,
    (State.FAILED, Event.ENABLE): State.FAILED,
    (State.FAILED, Event.DISABLE): State.FAILED,
    (State.FAILED, Event.STOP): State.FAILED,
    (State.FAILED, Event.RESET): State.DISABLED,
    (State.FAILED, Event.ESTOP_PRESS): State.FAILED,
    (State.FAILED, Event.ESTOP_RELEASE): State.FAILED,
}

# Requests that a state refuses, with a hint for the user.
REFUSALS = {
    (State.STOPPED, Event.ENABLE): "the robot is stopped: reset it first (%s)" % RESET,
    (State.ESTOP_PRESSED, Event.ENABLE): "the emergency stop is pressed: release it, then reset, then enable",
    (State.ESTOP_PRESSED, Event.RESET): "the emergency stop is pressed: release it, then reset",
    (State.ESTOP_RELEASED, Event.ENABLE): "the emergency stop was released but not reset: %s" % RESET,
    (State.FAILED, Event.ENABLE): "the robot has failed: reset it first (%s)" % RESET,
}


class RobotState:
    """The table with a current row."""

    def __init__(self, state: State = State.DISABLED) -> None:
        self.state = state

    @property
    def enabled(self) -> bool:
        return self.state is State.ENABLED

    @property
    def assembly(self) -> Assembly:
        """The AssemblyState fields that belong to the current state."""
        return ASSEMBLY[self.state]

    def fail(self) -> None:
        """The robot's own software has failed."""
        self.state = State.FAILED

    def require_enabled(self) -> None:
        """Raises CommandRefused unless the robot is enabled."""
        if not self.enabled:
            raise CommandRefused(NOT_ENABLED)

    def apply(self, event: Event) -> None:
        """Take one event. Raises CommandRefused, which says what to do, if the state does not allow it."""
        refusal = REFUSALS.get((self.state, event))
        if refusal is not None:
            raise CommandRefused(refusal)
        self.state = TRANSITIONS[self.state, event]
