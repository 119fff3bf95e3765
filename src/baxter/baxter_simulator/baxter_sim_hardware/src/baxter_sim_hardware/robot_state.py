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


class BaxterState(Enum):
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


class EstopButton(IntEnum):
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
    estop_button: EstopButton
    estop_source: Source


ASSEMBLY = {
    BaxterState.DISABLED: Assembly(False, False, False, False, EstopButton.UNPRESSED, Source.NONE),
    BaxterState.ENABLED: Assembly(True, True, False, False, EstopButton.UNPRESSED, Source.NONE),
    BaxterState.STOPPED: Assembly(False, False, True, False, EstopButton.UNKNOWN, Source.UNKNOWN),
    BaxterState.ESTOP_PRESSED: Assembly(False, False, True, False, EstopButton.PRESSED, Source.USER),
    BaxterState.ESTOP_RELEASED: Assembly(False, False, True, False, EstopButton.RELEASED, Source.USER),
    BaxterState.FAILED: Assembly(False, False, True, True, EstopButton.UNPRESSED, Source.FAULT),
}

# Every (state, event) pair has its row. Reset always ends disabled: the SDK's reset() waits for exactly that.
TRANSITIONS = {
    (BaxterState.DISABLED, Event.ENABLE): BaxterState.ENABLED,
    (BaxterState.DISABLED, Event.DISABLE): BaxterState.DISABLED,
    (BaxterState.DISABLED, Event.STOP): BaxterState.STOPPED,
    (BaxterState.DISABLED, Event.RESET): BaxterState.DISABLED,
    (BaxterState.DISABLED, Event.ESTOP_PRESS): BaxterState.ESTOP_PRESSED,
    (BaxterState.DISABLED, Event.ESTOP_RELEASE): BaxterState.DISABLED,
    (BaxterState.ENABLED, Event.ENABLE): BaxterState.ENABLED,
    (BaxterState.ENABLED, Event.DISABLE): BaxterState.DISABLED,
    (BaxterState.ENABLED, Event.STOP): BaxterState.STOPPED,
    (BaxterState.ENABLED, Event.RESET): BaxterState.DISABLED,
    (BaxterState.ENABLED, Event.ESTOP_PRESS): BaxterState.ESTOP_PRESSED,
    (BaxterState.ENABLED, Event.ESTOP_RELEASE): BaxterState.ENABLED,
    (BaxterState.STOPPED, Event.ENABLE): BaxterState.STOPPED,
    (BaxterState.STOPPED, Event.DISABLE): BaxterState.STOPPED,
    (BaxterState.STOPPED, Event.STOP): BaxterState.STOPPED,
    (BaxterState.STOPPED, Event.RESET): BaxterState.DISABLED,
    (BaxterState.STOPPED, Event.ESTOP_PRESS): BaxterState.ESTOP_PRESSED,
    (BaxterState.STOPPED, Event.ESTOP_RELEASE): BaxterState.STOPPED,
    (BaxterState.ESTOP_PRESSED, Event.ENABLE): BaxterState.ESTOP_PRESSED,
    (BaxterState.ESTOP_PRESSED, Event.DISABLE): BaxterState.ESTOP_PRESSED,
    (BaxterState.ESTOP_PRESSED, Event.STOP): BaxterState.ESTOP_PRESSED,
    (BaxterState.ESTOP_PRESSED, Event.RESET): BaxterState.ESTOP_PRESSED,
    (BaxterState.ESTOP_PRESSED, Event.ESTOP_PRESS): BaxterState.ESTOP_PRESSED,
    (BaxterState.ESTOP_PRESSED, Event.ESTOP_RELEASE): BaxterState.ESTOP_RELEASED,
    (BaxterState.ESTOP_RELEASED, Event.ENABLE): BaxterState.ESTOP_RELEASED,
    (BaxterState.ESTOP_RELEASED, Event.DISABLE): BaxterState.ESTOP_RELEASED,
    (BaxterState.ESTOP_RELEASED, Event.STOP): BaxterState.ESTOP_RELEASED,
    (BaxterState.ESTOP_RELEASED, Event.RESET): BaxterState.DISABLED,
    (BaxterState.ESTOP_RELEASED, Event.ESTOP_PRESS): BaxterState.ESTOP_PRESSED,
    (BaxterState.ESTOP_RELEASED, Event.ESTOP_RELEASE): BaxterState.ESTOP_RELEASED,
    (BaxterState.FAILED, Event.ENABLE): BaxterState.FAILED,
    (BaxterState.FAILED, Event.DISABLE): BaxterState.FAILED,
    (BaxterState.FAILED, Event.STOP): BaxterState.FAILED,
    (BaxterState.FAILED, Event.RESET): BaxterState.DISABLED,
    (BaxterState.FAILED, Event.ESTOP_PRESS): BaxterState.FAILED,
    (BaxterState.FAILED, Event.ESTOP_RELEASE): BaxterState.FAILED,
}

# Requests that a state refuses, with a hint for the user.
REFUSALS = {
    (BaxterState.STOPPED, Event.ENABLE): "the robot is stopped: reset it first (%s)" % RESET,
    (BaxterState.ESTOP_PRESSED, Event.ENABLE): "the emergency stop is pressed: release it, then reset, then enable",
    (BaxterState.ESTOP_PRESSED, Event.RESET): "the emergency stop is pressed: release it, then reset",
    (BaxterState.ESTOP_RELEASED, Event.ENABLE): "the emergency stop was released but not reset: %s" % RESET,
    (BaxterState.FAILED, Event.ENABLE): "the robot has failed: reset it first (%s)" % RESET,
}


class RobotState:
    """The table with a current row."""

    def __init__(self, state: BaxterState = BaxterState.DISABLED) -> None:
        self.state = state

    @property
    def enabled(self) -> bool:
        return self.state is BaxterState.ENABLED

    @property
    def assembly(self) -> Assembly:
        """The AssemblyState fields that belong to the current state."""
        return ASSEMBLY[self.state]

    def fail(self) -> None:
        """The robot's own software has failed."""
        self.state = BaxterState.FAILED

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
