# SPDX-License-Identifier: BSD-3-Clause
"""The electric gripper: commands in, set-point of its fingers out; what it feels follows from the fingers alone."""
import json
import math
from dataclasses import dataclass

from .errors import CommandRefused

PARAMETERS = {"velocity": 50.0, "moving_force": 40.0, "holding_force": 30.0, "dead_zone": 5.0}  # [%] at the start
FULL_SPEED = 0.1  # [m/s] of a finger at velocity 100 %
REACH = 0.1  # share of the travel by which the set-point may lead fingers that something stops
STILL = 0.05  # [travels/s] below which the fingers stand
PUSHING = 0.5  # share of the allowed force from which fingers that stand are stopped by something
OPEN, CLOSED = 1.0, 0.0


@dataclass(frozen=True)
class Feeling:
    """What the fingers tell: position and force in percent, and the flags of the state message."""

    position: float
    force: float
    moving: bool
    gripping: bool
    missed: bool


class ElectricGripper:
    """Positions are shares of the fingers' travel, 0 closed to 1 open, where no percents are named.

    travel: of one finger [m]; position: where the fingers are now; dt: length of a tick [s].
    """

    def __init__(self, travel, position, dt=0.002):
        self._step = FULL_SPEED / travel * dt
        self._dt = dt
        self.reset(position)

    def reset(self, position):
        """As at the start: calibrated, as the vendor's simulator is, and holding `position`."""
        self.parameters = dict(PARAMETERS)
        self.calibrated = True
        self.command, self.sender, self.sequence = "", "", 0
        self.stop(position)

    def stop(self, position):
        """Hold `position`."""
        self._setpoint = self._target = position
        self._plan = []  # where a calibration still has to go
        self._calibrating = False
        self._attempt = False  # closing, to hold something
        self.is_resting = False

    def take(self, command, args, sender, sequence, position, enabled):
        """One command message; position: of the fingers now; enabled: whether the robot is.

        args: JSON object or empty. Raises CommandRefused for an unknown command, for senseless arguments, and for
        motion while the robot is disabled or the gripper not calibrated. The echo of sender and sequence that
        acknowledges a command comes with every known one. A calibration or reboot that is sent again, as the SDK does
        until it sees the effect, is the same one.
        """
        if command not in _HANDLERS:
            raise CommandRefused("unknown gripper command '%s'; choices are %s" % (command, ", ".join(_HANDLERS)))
        handler, moves = _HANDLERS[command]
        repeated = sender and (command, sender, sequence) == (self.command, self.sender, self.sequence)
        self.command, self.sender, self.sequence = command, sender, sequence
        if repeated and command in ("calibrate", "reboot"):
            return
        values = _parse(args)
        if moves and not enabled:
            raise CommandRefused("the robot is disabled")
        handler(self, values, position)

    def update(self, position, feeling):
        """One tick, for fingers that do not rest. Returns (set-point, force [%] that may be used).

        feeling: the present Feeling.
        """
        step = self._step * self.parameters["velocity"] / 100.0
        setpoint = self._setpoint + min(max(self._target - self._setpoint, -step), step)
        self._setpoint = min(max(setpoint, position - REACH), position + REACH)
        if not feeling.moving:
            if self._plan:
                self._target = self._plan.pop(0)
            elif self._calibrating:
                self.calibrated, self._calibrating = True, False
            elif not feeling.gripping and self._setpoint == self._target:
                self.is_resting = True
        return self._setpoint, self.parameters["holding_force" if feeling.gripping else "moving_force"]

    def feel(self, position, speed, force):
        """The Feeling of fingers at `position` with `speed` [travels/s], pressing with `force` [% of the joint's]."""
        dead = self.parameters["dead_zone"] / 100.0
        gap = position - self._target
        allowed = min(self.parameters["holding_force"], self.parameters["moving_force"])
        stands = abs(speed) < STILL
        stopped = stands and abs(gap) > dead and force >= PUSHING * allowed
        arrived = stands and abs(gap) <= dead
        return Feeling(100.0 * min(max(position, 0.0), 1.0), min(force, 100.0), not (stopped or arrived),
                       stopped and gap > 0.0, arrived and self._attempt)

    def _go_to(self, target):
        if not self.calibrated:
            raise CommandRefused("the gripper is not calibrated: calibrate it first")
        self._plan = []
        self._target = target
        self._attempt = 100.0 * target <= self.parameters["dead_zone"]
        self.is_resting = False

    def _go(self, values, position):
        percent = values.get("position")
        if not _is_number(percent):
            raise CommandRefused('go needs {"position": 0 to 100}, not %s' % json.dumps(values))
        self._go_to(min(max(percent, 0.0), 100.0) / 100.0)

    def _configure(self, values, position):
        for name, value in values.items():
            if name not in PARAMETERS or not (_is_number(value) and 0.0 <= value <= 100.0):
                raise CommandRefused("configure: %s is %r; parameters are %s, each from 0 to 100" % (
                    name, value, ", ".join(PARAMETERS)))
        self.parameters.update(values)

    def _calibrate(self, values, position):
        self.stop(position)
        self.calibrated = False
        self._target, self._plan, self._calibrating = CLOSED, [OPEN], True

    def _clear_calibration(self, values, position):
        self.stop(position)
        self.calibrated = False

    def _reboot(self, values, position):
        self._clear_calibration(values, position)
        self.parameters = dict(PARAMETERS)


def _parse(args):
    try:
        values = json.loads(args) if args.strip() else {}
    except ValueError as error:
        raise CommandRefused("args are %r; they must be a JSON object (%s)" % (args, error)) from None
    if not isinstance(values, dict):
        raise CommandRefused("args are %r; they must be a JSON object" % args)
    return values


def _is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _nothing(gripper, values, position):
    pass


# {command: (function(gripper, values, position), whether it moves the fingers)}
_HANDLERS = {
    "no_op": (_nothing, False),
    "set": (ElectricGripper._configure, False),
    "configure": (ElectricGripper._configure, False),
    "reset": (_nothing, False),  # there is no fault to clear
    "reboot": (ElectricGripper._reboot, False),
    "calibrate": (ElectricGripper._calibrate, True),
    "clear_calibration": (ElectricGripper._clear_calibration, False),
    "go": (ElectricGripper._go, True),
    "grip": (lambda gripper, values, position: gripper._go_to(CLOSED), True),
    "prepare_to_grip": (lambda gripper, values, position: gripper._go_to(OPEN), True),
    "release": (lambda gripper, values, position: gripper._go_to(OPEN), True),
    "stop": (lambda gripper, values, position: gripper.stop(position), False),
}
