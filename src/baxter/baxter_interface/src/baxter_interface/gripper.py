# SPDX-License-Identifier: BSD-3-Clause
"""The gripper on one arm, whatever kind it is."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from baxter_core_msgs.msg import EndEffectorProperties, EndEffectorState

from baxter_model import CUSTOM, ELECTRIC

from . import settings
from .gripper_link import GripperLink
from .gripper_types import clip_percent, judge_firmware
from .joint_checks import require_number, require_side
from .version_check import VersionMismatch


class Gripper:
    """The gripper of the "left" or the "right" arm.

    Positions, forces and speeds are in percent; position 0 is closed, 100 open. A command that a kind of gripper does
    not have is logged, and returns None. A blocking command returns whether it had its effect; if not, it logs one
    line.

    Parameters:
        versioned: compare the firmware of an electric gripper with this SDK.
    Attributes:
        name: "left_gripper" or "right_gripper".
        on_type_changed (str), on_gripping_changed (bool), on_moving_changed (bool): Signals.
    Waits up to 30 s of wall time for a robot that is still starting, and 5 s for the gripper of one that is up.
    Sends the default parameters. Raises UnknownNameError (a ValueError and a KeyError) for another side, OSError with
    errno ETIMEDOUT if there is no gripper, VersionMismatch (an OSError) if `versioned` and the firmware does not fit,
    rospy.ROSInitException before rospy.init_node.
    """

    def __init__(self, gripper: str, versioned: bool = False) -> None:
        self._link = GripperLink(require_side(gripper))
        self.name = self._link.name
        self.on_type_changed = self._link.on_type_changed
        self.on_gripping_changed = self._link.on_gripping_changed
        self.on_moving_changed = self._link.on_moving_changed
        if versioned and self.type() == ELECTRIC.name and not self.version_check():
            self._link.unregister()
            raise VersionMismatch("%s: %s" % (self.name, self._firmware()[1]))
        self.set_parameters(defaults=True)

    def version_check(self) -> bool:
        """Tell whether the firmware of an electric gripper fits this SDK; log the result."""
        if self.type() != ELECTRIC.name:
            self._link.warn("only an electric gripper has firmware with a version to check")
            return True
        fits, text = self._firmware()
        if text:
            (rospy.logwarn if fits else rospy.logerr)("%s: %s", self.name, text)
        return fits

    def command(self, cmd: str, block: bool = False, test: Callable[[], bool] = lambda: True, timeout: float = 0.0,
                args: dict[str, Any] | None = None) -> bool:
        """Send a command with `args` (a dict). Returns True if not `block`, else whether `test()` came true."""
        return self._link.command(cmd, block, test, timeout, args)

    def valid_parameters_text(self) -> str:
        """Describe the parameters of this kind of gripper, with their defaults."""
        defaults = self.valid_parameters()
        if not defaults:
            return "a gripper of type %s has no parameters" % self.type()
        return "the parameters of type %s and their defaults are: %s" % (
            self.type(), ", ".join("%s %g" % item for item in defaults.items()))

    def valid_parameters(self) -> dict[str, Any]:
        """Return the default parameters of this kind of gripper as a dict."""
        return dict(getattr(self._link.kind, "defaults", {}))

    def set_parameters(self, parameters: dict[str, Any] | None = None, defaults: bool = False) -> None:
        """Change parameters (dict), after a reset to the defaults if `defaults`, and send them all; unknown ones are
        logged."""
        valid = self.valid_parameters()
        if defaults:
            self._link.parameters = dict(valid)
        for name, value in (parameters or {}).items():
            if name in valid:
                self._link.parameters[name] = value
            else:
                self._link.warn("there is no parameter %r; %s" % (name, self.valid_parameters_text()))
        self._link.configure()

    def reset_custom_properties(self, timeout: float = 2.0) -> bool | None:
        """Tell the robot the default properties of a custom gripper; return whether it took them in `timeout` [s]."""
        if not self._is_custom("reset_custom_properties"):
            return None
        wanted = EndEffectorProperties(id=CUSTOM.id, ui_type=CUSTOM.ui_type)
        return self._link.override("set_properties", wanted, lambda: self._link.properties == wanted, timeout)

    def reset_custom_state(self, timeout: float = 2.0) -> bool | None:
        """Tell the robot the default state of a custom gripper, unknown in all fields; return whether it accepted
        it."""
        if not self._is_custom("reset_custom_state"):
            return None
        flags = ("enabled", "calibrated", "ready", "moving", "gripping", "missed", "error", "reverse")
        wanted = EndEffectorState(id=CUSTOM.id, **dict.fromkeys(flags, EndEffectorState.STATE_UNKNOWN))
        return self._link.override(
            "set_state", wanted,
            lambda: all(getattr(self._link.state, name) == getattr(wanted, name) for name in ("id", *flags)), timeout)

    def reset(self, block: bool = True, timeout: float = 2.0) -> bool | None:
        """Clear errors (electric)."""
        return self._do("reset", block, timeout)

    def reboot(self, timeout: float = 5.0, delay_check: float = 0.1) -> bool | None:
        """Restart the gripper and wait for it (electric). It has to be calibrated again afterwards."""
        return self._do("reboot", timeout, delay_check)

    def clear_calibration(self, block: bool = True, timeout: float = 2.0) -> bool | None:
        """Clear the calibration (electric)."""
        return self._do("clear_calibration", block, timeout)

    def calibrate(self, block: bool = True, timeout: float = 5.0) -> bool | None:
        """Calibrate, after clearing an old calibration and errors, and send the parameters again (electric)."""
        return self._do("calibrate", block, timeout)

    def stop(self, block: bool = True, timeout: float = 5.0) -> bool | None:
        """Stop the fingers (electric), or release what is held with a blow of air (suction)."""
        return self._do("stop", block, timeout)

    def command_position(self, position: float, block: bool = False, timeout: float = 5.0) -> bool | None:
        """Move to `position`, 0.0 closed to 100.0 open (electric; suction: 100 releases, less sucks).

        Returns False if an electric gripper is not calibrated. Raises ValueError for a number that is not finite.
        """
        return self._do("command_position", require_number(position, "the gripper's position [%]"), block, timeout)

    def command_suction(self, block: bool = False, timeout: float = 5.0) -> bool | None:
        """Suck until something is held, for `timeout` [s] at most (suction)."""
        return self._do("command_suction", block, timeout)

    def open(self, block: bool = False, timeout: float = 5.0) -> bool | None:
        """Open, or release (electric, suction)."""
        return self._do("open", block, timeout)

    def close(self, block: bool = False, timeout: float = 5.0) -> bool | None:
        """Close, or suck (electric, suction)."""
        return self._do("close", block, timeout)

    def set_velocity(self, velocity: float) -> None:
        """Set the speed of position moves, clipped to 0 ... 100 (electric)."""
        self._set_percent("velocity", velocity)

    def set_moving_force(self, force: float) -> None:
        """Set the force above which a moving gripper grips, clipped to 0 ... 100 (electric)."""
        self._set_percent("moving_force", force)

    def set_holding_force(self, force: float) -> None:
        """Set the force of holding, clipped to 0 ... 100 (electric)."""
        self._set_percent("holding_force", force)

    def set_dead_band(self, dead_band: float) -> None:
        """Set the error of position below which it has arrived, clipped to 0 ... 100 (electric)."""
        self._set_percent("dead_zone", dead_band)

    def set_vacuum_threshold(self, threshold: float) -> None:
        """Set the vacuum above which something is held, clipped to 0 ... 100 (suction)."""
        self._set_percent("vacuum_sensor_threshold", threshold)

    def set_blow_off(self, blow_off: float) -> None:
        """Set how long a release blows [s] (suction)."""
        self.set_parameters({"blow_off_seconds": require_number(blow_off, "the blow-off [s]")})

    def parameters(self) -> dict[str, Any]:
        """Return the parameters as a dict."""
        return dict(self._link.parameters)

    def calibrated(self) -> bool:
        """Tell whether the gripper is calibrated."""
        return self._link.state.calibrated == 1

    def ready(self) -> bool:
        """Tell whether the gripper takes commands."""
        return self._link.state.ready == 1

    def moving(self) -> bool:
        """Tell whether the gripper moves."""
        return self._link.state.moving == 1

    def gripping(self) -> bool:
        """Tell whether the gripper holds something."""
        return self._link.state.gripping == 1

    def missed(self) -> bool:
        """Tell whether the gripper closed on nothing."""
        return self._link.state.missed == 1

    def error(self) -> bool:
        """Tell whether the gripper has an error."""
        return self._link.state.error == 1

    def position(self) -> float:
        """Return the position, 0.0 closed to 100.0 open."""
        return self._link.state.position

    def force(self) -> float:
        """Return the force, 0.0 to 100.0."""
        return self._link.state.force

    def vacuum_sensor(self) -> float | None:
        """Return the vacuum, 0.0 to 100.0 (suction)."""
        return self._do("vacuum_sensor")

    def vacuum(self) -> bool | None:
        """Tell whether the vacuum is above its threshold (suction)."""
        return self._do("vacuum")

    def blowing(self) -> bool | None:
        """Tell whether the gripper blows (suction)."""
        return self._do("blowing")

    def sucking(self) -> bool | None:
        """Tell whether the gripper sucks (suction)."""
        return self._do("sucking")

    def has_force(self) -> bool:
        """Tell whether the gripper's force can be commanded."""
        return self._link.properties.controls_force

    def has_position(self) -> bool:
        """Tell whether the gripper's position can be commanded."""
        return self._link.properties.controls_position

    def type(self) -> str | None:
        """Return "suction", "electric", "custom", or None while no gripper is mounted."""
        return getattr(self._link.kind, "name", None)

    def hardware_id(self) -> int:
        """Return the id that commands carry (int)."""
        return self._link.state.id

    def hardware_name(self) -> str:
        """Return the product's name."""
        return self._link.properties.product

    def firmware_build_date(self) -> str:
        """Return the date of the firmware, like "2014/7/24 18:30:00"."""
        return self._link.properties.firmware_date

    def firmware_version(self) -> str:
        """Return the version of the firmware."""
        return self._link.properties.firmware_rev

    def _do(self, method, *args):
        action = getattr(self._link.kind, method, None)
        if action is None:
            self._link.warn("a gripper of type %s cannot do %s" % (self.type(), method))
            return None
        return action(*args)

    def _is_custom(self, method) -> bool:
        if self.type() == CUSTOM.name:
            return True
        self._link.warn("%s is for custom grippers, this one is of type %s" % (method, self.type()))
        return False

    def _set_percent(self, name: str, value: float) -> None:
        self.set_parameters({name: clip_percent(require_number(value, "the gripper's %s [%%]" % name))})

    def _firmware(self):
        return judge_firmware(self.firmware_build_date(), settings.VERSIONS_SDK2GRIPPER[settings.SDK_VERSION])
