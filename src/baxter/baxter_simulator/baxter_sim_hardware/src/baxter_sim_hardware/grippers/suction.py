# SPDX-License-Identifier: BSD-3-Clause
"""The suction gripper: commands in, pressure in its cup out. Only that pressure holds an object."""

from __future__ import annotations

import json
import math
from typing import Any

from baxter_model import SUCTION
from baxter_sim_hardware.errors import CommandRefused

from .commands import GripperHardware, is_number

FULL_VACUUM_PA = 60e3  # below the air around, at a sensor reading of 100 %; what a venturi pump of this size reaches
BLOW_PA = 1e3  # above the air around
LEAKING = 0.05  # share of the full vacuum in a cup that sucks air
EVACUATE_S, FILL_S = 0.1, 0.02  # time constants of the pressure in a cup that is closed by something, and that is not
EMPTY = 1e-3  # share of the full vacuum that is none
SENSOR_MAX = 255
ATTEMPT_S = 5.0  # of a command that names no time
LARGEST = {"vacuum_sensor_threshold": 100.0, "blow_off_seconds": 60.0}  # of each parameter [%], [s]


class SuctionGripperHardware(GripperHardware):
    """One cup on a pump.

    Attributes: sucking: whether the pump does; missed: an attempt ended without a vacuum. dt: length of a tick [s].
    """

    PARAMETERS = {name: (start, LARGEST[name]) for name, start in SUCTION.parameters.items()}
    COMMANDS = {
        "no_op": ("no_op", False),
        "set": ("configure", False),
        "configure": ("configure", False),
        "reset": ("no_op", False),  # there is no fault to clear
        "reboot": ("_reboot", False),
        "go": ("_go", True),
        "grip": ("_go", True),
        "prepare_to_grip": ("_stop", False),
        "release": ("_release", False),
        "stop": ("_stop", False),
    }
    ONCE = ("go", "grip", "release", "reboot")

    def __init__(self, dt: float = 0.002) -> None:
        self._dt = dt
        super().__init__()
        self.reset()

    def reset(self) -> None:
        """As at the start: no vacuum, no command."""
        self.forget()
        self.missed = False
        self._level = 0.0  # share of the full vacuum
        self._stop({})

    @property
    def idle(self) -> bool:
        """Whether the cup is at ambient pressure, and stays so."""
        return not (self.sucking or self.blowing or self._level)

    @property
    def blowing(self) -> bool:
        return self._blow_left_s > 0.0

    @property
    def vacuum(self) -> bool:
        """Whether there is enough vacuum to hold something."""
        return 100.0 * self._level >= self.parameters["vacuum_sensor_threshold"] and self._level > 2.0 * LEAKING

    @property
    def flags(self) -> dict[str, bool]:
        # There is nothing to calibrate; clients read this as calibrated.
        return {"calibrated": True, "ready": True, "moving": False, "gripping": self.vacuum, "missed": self.missed,
                "error": False}

    @property
    def sensor(self) -> int:
        """Reading of the vacuum sensor, 0 to 255."""
        return round(SENSOR_MAX * self._level)

    @property
    def details(self) -> str:
        """The JSON text in the state message."""
        return json.dumps({"vacuum sensor": self.sensor, "vacuum": self.vacuum, "blowing": self.blowing,
                           "sucking": self.sucking})

    def update(self, is_closed: bool) -> float:
        """One tick. Returns the pressure in the cup [Pa], negative for a vacuum.

        is_closed: whether something lies on the cup, all around its rim.
        """
        rest, constant = (1.0, EVACUATE_S) if is_closed else (LEAKING, FILL_S)
        if not self.sucking:
            rest, constant = 0.0, FILL_S
        self._level = rest + (self._level - rest) * math.exp(-self._dt / constant)
        if self._level < EMPTY and not self.sucking:
            self._level = 0.0
        self._blow_left_s = max(self._blow_left_s - self._dt, 0.0)
        if self.vacuum:
            self._attempt_left_s, self.missed = self._attempt_s, False
        elif self.sucking:
            self._attempt_left_s -= self._dt
            if self._attempt_left_s <= 0.0:
                self.sucking, self.missed = False, True
        return BLOW_PA if self.blowing else -FULL_VACUUM_PA * self._level

    def end_attempt(self) -> None:
        """Continue to suck only if something is held, and stop blowing: a held object does not fall when the robot is
        disabled."""
        if not self.vacuum:
            self._stop({})

    def set_pump(self, on: bool) -> None:
        """Suck without a time limit, or end that: the function of the pump valve's digital output."""
        if on and not self.sucking:
            self._start(math.inf)
        elif not on and self.sucking:
            self._stop({})

    def set_blow(self, on: bool) -> None:
        """Blow without a time limit, or end that: the function of the blow-off valve's digital output."""
        if on:
            self._stop({})
        self._blow_left_s = math.inf if on else 0.0

    def _go(self, values: dict[str, Any]) -> None:
        seconds = values.get("grip_attempt_seconds", ATTEMPT_S)
        if set(values) - {"grip_attempt_seconds"} or not (is_number(seconds) or seconds == math.inf):
            raise CommandRefused('%s needs {"grip_attempt_seconds": SECONDS}, less than 0 for as long as it takes, '
                                 "not %s" % (self.command, json.dumps(values)))
        self._start(seconds if seconds >= 0.0 else math.inf)

    def _start(self, attempt_s: float) -> None:
        self.sucking, self.missed = True, False
        self._attempt_s = self._attempt_left_s = attempt_s
        self._blow_left_s = 0.0

    def _release(self, values: dict[str, Any]) -> None:
        self._stop(values)
        self._blow_left_s = self.parameters["blow_off_seconds"]

    def _stop(self, values: dict[str, Any]) -> None:
        self.sucking = False
        self._attempt_s = self._attempt_left_s = self._blow_left_s = 0.0

    def _reboot(self, values: dict[str, Any]) -> None:
        self._stop(values)
        self.parameters = {name: start for name, (start, _) in self.PARAMETERS.items()}
