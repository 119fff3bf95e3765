# SPDX-License-Identifier: BSD-3-Clause
"""The electric gripper: commands in, set-point of its fingers out; it computes its force from the fingers alone."""

from __future__ import annotations

import json
from enum import Enum
from typing import TYPE_CHECKING, Any

from baxter_model import ELECTRIC
from baxter_sim_hardware.errors import CommandRefused

from .commands import GripperHardware, is_number

if TYPE_CHECKING:
    from collections.abc import Callable

FULL_SPEED = 0.1  # [m/s] of a finger at velocity 100 %
REACH = 0.1  # share of the travel by which the set-point may lead fingers that something stops
STILL = 0.05  # [travels/s] below which the fingers stand, and half of the commanded speed where that is less
PRESSING = 1.15  # force that moving fingers use, per moving force, which is what they must exceed to grip
MOST = 95.0  # [%] force that counts as exceeding any moving force
PUSHING = 0.5  # share of the allowed force above which fingers that stand for long are stopped by an obstacle
LOOSE = 0.25  # share of the allowed force below which what was held is gone
SETTLE_S = 0.04  # time that they must stand, or that the held object must be missing
CONFIRM_S = 0.1  # time that they must press: clients that read the force 20 times per second must see it
GIVE_UP_S = 0.5  # after which fingers that stand short of their target, with nothing between them, are left there
END_STOP = 0.02  # share of the travel within which a calibration must find the ends
OPEN, CLOSED = 1.0, 0.0


class Phase(Enum):
    """The phase of the fingers' motion."""

    RESTING = "resting"
    MOVING = "moving"
    HOLDING = "holding"


class ElectricGripperHardware(GripperHardware):
    """Positions are shares of the fingers' travel, 0 closed to 1 open, unless given in percent.

    travel: of one finger [m]; position: present position of the fingers; dt: length of a tick [s]; calibrated: whether
    it begins calibrated, as in the vendor's simulator. The physical robot's does not.
    Attributes: calibrated, error, missed: flags of the state message.
    """

    PARAMETERS = {name: (start, 100.0) for name, start in ELECTRIC.parameters.items()}  # [%]
    COMMANDS = {
        "no_op": ("no_op", False),
        "set": ("configure", False),
        "configure": ("configure", False),
        "reset": ("_reset_error", False),
        "reboot": ("_reboot", False),
        "calibrate": ("_calibrate", True),
        "clear_calibration": ("_clear_calibration", True),
        "go": ("_go", True),
        "grip": ("_grip", True),
        "prepare_to_grip": ("_open", True),
        "release": ("_open", True),
        "stop": ("_stop", False),
    }
    ONCE = ("calibrate", "reboot")

    def __init__(self, travel: float, position: float, dt: float = 0.002, calibrated: bool = True) -> None:
        self._travel, self._dt = travel, dt
        self._position = position
        self._is_calibrated_at_start, self.calibrated = calibrated, False
        super().__init__()
        self.reset(position)

    def reset(self, position: float) -> None:
        """As at the start, holding `position`; it stays calibrated if it was."""
        self.forget()
        self.calibrated, self.error = self.calibrated or self._is_calibrated_at_start, False
        self._stand_at(position)

    def stop(self, position: float) -> None:
        """Move no further than `position`, where the fingers are; a held object stays held.

        A running calibration is aborted.
        """
        if self._phase is Phase.HOLDING:
            self._stays = True
            return
        was_resting, still = self.resting, (self._here, self._still_s)
        self._stand_at(position)
        # No motion follows, so the time at rest so far counts: clients repeat a stop until the fingers stand.
        self._here, self._still_s = still
        if was_resting:
            self._come_to_rest()

    @property
    def flags(self) -> dict[str, bool]:
        return {"calibrated": self.calibrated, "ready": self.ready, "moving": self.moving, "gripping": self.gripping,
                "missed": self.missed, "error": self.error}

    @property
    def ready(self) -> bool:
        """Whether it takes commands to move: not while it calibrates, nor with an error."""
        return not self._calibrating and not self.error

    @property
    def resting(self) -> bool:
        """Whether the fingers are at their target, and held there."""
        return self._phase is Phase.RESTING

    @property
    def moving(self) -> bool:
        """Whether the fingers are on their way."""
        return self._phase is Phase.MOVING

    @property
    def gripping(self) -> bool:
        """Whether the fingers press on something that keeps them from their target."""
        return self._phase is Phase.HOLDING

    @property
    def hooked(self) -> bool:
        """Whether something keeps the fingers from opening."""
        return self.moving and self._still_s >= SETTLE_S and self._target > self._position + self._dead

    def update(self, position: float, squeeze: Callable[[], float]) -> tuple[float, float] | None:
        """One tick. Returns (set-point, force [% of the joints'] that may be used), or None if the last one still
        applies.

        position: of the fingers; squeeze: function that returns the force on them [%].
        """
        self._position = position
        if self._phase is Phase.RESTING:
            if self._is_near(self._rest):
                return None
            self._phase = Phase.MOVING
        if self._phase is Phase.MOVING:
            self._watch()
            if self._still_s >= SETTLE_S:
                self._arrive(squeeze())
        elif squeeze() >= LOOSE * self._allowed:
            self._loose_s = 0.0
        else:
            self._loose_s += self._dt
            if self._loose_s >= SETTLE_S and self._stays:
                self._stand_at(position)
            elif self._loose_s >= SETTLE_S:
                self._move_to(self._target)
        step = 0.0 if self._stays else self._speed * self._dt
        setpoint = self._setpoint + min(max(self._target - self._setpoint, -step), step)
        self._setpoint = min(max(setpoint, position - REACH), position + REACH)
        if self.gripping:
            return self._setpoint, self.parameters["holding_force"]
        return self._setpoint, min(PRESSING * self.parameters["moving_force"], 100.0)

    @property
    def _speed(self) -> float:
        """[travels/s] that is commanded."""
        return FULL_SPEED / self._travel * self.parameters["velocity"] / 100.0

    @property
    def _dead(self) -> float:
        return self.parameters["dead_zone"] / 100.0

    @property
    def _allowed(self) -> float:
        """Force [%] that the fingers certainly reach on a held object."""
        return min(self.parameters["holding_force"], self.parameters["moving_force"])

    def _stand_at(self, position: float) -> None:
        self._plan = []  # where a calibration still has to go
        self._calibrating = False
        self.missed = self._attempt = False
        self._setpoint = position
        self._move_to(position)

    def _move_to(self, target: float) -> None:
        self._target = target
        self._stays = False  # whether to stay here when what is held is gone
        self._phase = Phase.MOVING
        self._still_s = self._loose_s = 0.0
        self._here = self._position  # where they have been, nearly, for so long

    def _watch(self) -> None:
        """Count how long the fingers have stood still, judged by position, not by speed: jammed fingers may rattle."""
        self._still_s += self._dt
        if abs(self._position - self._here) > min(STILL, 0.5 * self._speed) * SETTLE_S and self._speed:
            self._here, self._still_s = self._position, 0.0

    def _arrive(self, squeeze: float) -> None:
        """The fingers stand still: find out why, and choose the next phase."""
        is_there = self._is_near(self._target) and self._setpoint == self._target
        presses = squeeze > min(self.parameters["moving_force"], MOST)
        if presses or (self._still_s >= GIVE_UP_S and squeeze >= max(PUSHING * self._allowed, 1.0)):
            if self._calibrating:
                self._fail()
            elif self._still_s >= CONFIRM_S:
                self._phase, self._loose_s = Phase.HOLDING, 0.0
        elif is_there and self._plan and self._at_end:
            self._move_to(self._plan.pop(0))
        elif is_there and (not self._calibrating or self._at_end):
            self.calibrated = self.calibrated or self._calibrating
            self._calibrating = False
            self.missed = self._attempt
            self._come_to_rest()
        elif self._still_s >= GIVE_UP_S:
            if self._calibrating:
                self._fail()
            else:
                self._come_to_rest()

    def _is_near(self, target: float) -> bool:
        return abs(self._position - target) <= max(self._dead, END_STOP)

    @property
    def _at_end(self) -> bool:
        return abs(self._position - self._target) <= END_STOP

    def _come_to_rest(self) -> None:
        self._phase, self._rest = Phase.RESTING, self._position

    def _fail(self) -> None:
        """Fail: the calibration did not find the ends of the travel."""
        self._stand_at(self._position)
        self.error = True

    def _go_to(self, target: float) -> None:
        if not self.calibrated:
            raise CommandRefused("the gripper is not calibrated: calibrate it first")
        before, self._attempt = self._target, target <= self._dead
        if self.gripping and (target - self._position) * (before - self._position) > 0.0:
            self._target, self._stays = target, False  # it holds on, and would now close so far
        elif target != before or not (self.moving or self._is_near(target)):
            self.missed = False
            self._move_to(target)

    def _go(self, values: dict[str, Any]) -> None:
        percent = values.get("position")
        if not is_number(percent):
            raise CommandRefused('go needs {"position": 0 to 100}, not %s' % json.dumps(values))
        self._go_to(min(max(percent, 0.0), 100.0) / 100.0)

    def _grip(self, values: dict[str, Any]) -> None:
        self._go_to(CLOSED)

    def _open(self, values: dict[str, Any]) -> None:
        self._go_to(OPEN)

    def _stop(self, values: dict[str, Any]) -> None:
        self.stop(self._position)

    def _reset_error(self, values: dict[str, Any]) -> None:
        self.error = False

    def _calibrate(self, values: dict[str, Any]) -> None:
        self._clear_calibration(values)
        self.error = False
        self._calibrating, self._plan = True, [OPEN]
        self._move_to(CLOSED)

    def _clear_calibration(self, values: dict[str, Any]) -> None:
        self._stop(values)
        self.calibrated = False

    def _reboot(self, values: dict[str, Any]) -> None:
        self._clear_calibration(values)
        self.error = False
        self.parameters = {name: start for name, (start, _) in self.PARAMETERS.items()}
