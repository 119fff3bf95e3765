# SPDX-License-Identifier: BSD-3-Clause
"""The commands of each kind of gripper, one class per kind. Free of ROS.

A kind has only the methods that it supports; the public Gripper logs the use of another one. Each works on a `link`
with `command(command, block, test, timeout_s, args)` → bool, `state` (the last EndEffectorState), `details` (its JSON
object), `parameters` (the configured values), `configure()`, `sleep(duration_s)` and `warn(text)`. Flags of the state
are 0, 1, or 2 for unknown: only 1 counts as true.
"""
from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from baxter_model import CUSTOM, ELECTRIC, SUCTION

if TYPE_CHECKING:
    from .gripper_link import GripperLink

CLOSED, OPEN = 0.0, 100.0
DATE_FORMAT = "%Y/%m/%d %H:%M:%S"
# After a reboot, the gripper publishes its state this long before it takes commands [s].
REBOOT_PAUSE_S = 1.0


def clip_percent(value: float) -> float:
    """Clip a number to 0.0 ... 100.0."""
    return max(0.0, min(100.0, value))


class CustomGripper:
    """A tool that is unknown to the robot, without motor and parameters."""

    name, defaults = CUSTOM.name, CUSTOM.parameters

    def __init__(self, link: GripperLink) -> None:
        self._link = link


class ElectricGripper:
    """Two fingers on a motor; position and force in percent, 0 is closed."""

    name, defaults = ELECTRIC.name, ELECTRIC.parameters

    def __init__(self, link: GripperLink) -> None:
        self._link = link

    def reset(self, block: bool, timeout_s: float) -> bool:
        return self._link.command("reset", block, lambda: self._ready() and self._link.state.error != 1, timeout_s)

    def reboot(self, timeout_s: float, delay_check_s: float) -> bool:
        done = self._link.command("reboot", True, lambda: self._ready() and self._link.state.enabled == 1, timeout_s,
                                  delay_s=delay_check_s)
        self._link.sleep(REBOOT_PAUSE_S)
        self._link.configure()
        return done

    def clear_calibration(self, block: bool, timeout_s: float) -> bool:
        return self._link.command("clear_calibration", block,
                                  lambda: self._ready() and self._link.state.calibrated != 1, timeout_s)

    def calibrate(self, block: bool, timeout_s: float) -> bool:
        if self._link.state.calibrated == 1:
            self.clear_calibration(block, timeout_s)
        if self._link.state.error == 1:
            self.reset(block, timeout_s)
        done = self._link.command("calibrate", block, lambda: self._ready() and self._link.state.calibrated == 1,
                                  timeout_s)
        self._link.configure()
        return done

    def stop(self, block: bool, timeout_s: float) -> bool:
        return self._link.command("stop", block, lambda: self._link.state.moving != 1, timeout_s)

    def command_position(self, position: float, block: bool, timeout_s: float) -> bool:
        if self._link.state.calibrated != 1:
            self._link.warn("it is not calibrated, so it does not move: call calibrate() first")
            return False
        position = clip_percent(position)
        # The dead zone at the start of this command, even if it is changed meanwhile.
        dead_zone = self._link.parameters["dead_zone"]
        return self._link.command(
            "go", block,
            lambda: abs(self._link.state.position - position) < dead_zone or self._link.state.gripping == 1,
            timeout_s, {"position": position})

    def open(self, block: bool, timeout_s: float) -> bool:
        return self.command_position(OPEN, block, timeout_s)

    def close(self, block: bool, timeout_s: float) -> bool:
        return self.command_position(CLOSED, block, timeout_s)

    def _ready(self) -> bool:
        return self._link.state.ready == 1


class SuctionGripper:
    """A cup on a vacuum pump: it sucks, holds, and blows off."""

    name, defaults = SUCTION.name, SUCTION.parameters

    def __init__(self, link: GripperLink) -> None:
        self._link = link

    def stop(self, block: bool, timeout_s: float) -> bool:
        return self._link.command("release", block, lambda: not (self.sucking() or self.blowing()),
                                  max(self._link.parameters["blow_off_seconds"], timeout_s))

    def command_suction(self, block: bool, timeout_s: float) -> bool:
        return self._link.command("go", block, self.vacuum, timeout_s, {"grip_attempt_seconds": timeout_s})

    def command_position(self, position: float, block: bool, timeout_s: float) -> bool:
        return self.open(block, timeout_s) if position >= OPEN else self.close(block, timeout_s)

    def open(self, block: bool, timeout_s: float) -> bool:
        return self.stop(block, timeout_s)

    def close(self, block: bool, timeout_s: float) -> bool:
        return self.command_suction(block, timeout_s)

    def vacuum_sensor(self) -> float:
        """Vacuum in percent; the sensor counts to 255."""
        return float(self._link.details.get("vacuum sensor", 0.0)) / 255.0 * 100.0

    def vacuum(self) -> bool:
        return bool(self._link.details.get("vacuum", False))

    def blowing(self) -> bool:
        return bool(self._link.details.get("blowing", False))

    def sucking(self) -> bool:
        return bool(self._link.details.get("sucking", False))


# By EndEffectorProperties.ui_type.
TYPES = {SUCTION.ui_type: SuctionGripper, ELECTRIC.ui_type: ElectricGripper, CUSTOM.ui_type: CustomGripper}


def judge_firmware(date: str, dates: dict[str, str]) -> tuple[bool, str]:
    """Compare a gripper's firmware date with a row of VERSIONS_SDK2GRIPPER: return (fits, message)."""
    try:
        found = datetime.strptime(date, DATE_FORMAT)
    except ValueError:
        return False, "its firmware date is %r, which is not like %s" % (date, dates["warn"])
    if found <= datetime.strptime(dates["fail"], DATE_FORMAT):
        return False, "its firmware of %s is too old for this SDK: newer than %s is needed" % (date, dates["fail"])
    if found <= datetime.strptime(dates["warn"], DATE_FORMAT):
        return True, "its firmware of %s is old; this SDK was made for newer than %s" % (date, dates["warn"])
    return True, ""
