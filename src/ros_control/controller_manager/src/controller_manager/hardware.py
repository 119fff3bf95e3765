# SPDX-License-Identifier: BSD-3-Clause
"""The joints that controllers see: state arrays to read, command arrays to write. ROS-free."""
from __future__ import annotations

import enum
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import ControllerError, HardwareError
from .interfaces import COMMAND, JOINT_STATE, POSITIONS


class SwitchResult(enum.Enum):
    """Progress of the hardware in a change of controllers."""

    DONE = "done"
    ONGOING = "ongoing"
    ERROR = "error"


class RobotHardware:
    """n joints; all arrays are (n,) float64 in the order of ``joint_names``, in SI units and radians.

    Attributes
    ----------
    position, velocity, effort :
        The measured state, written in place before each update. Copy values that you keep.
    command : dict
        {interface of ``interfaces.COMMAND``: array}. Only the entries of the joints that have the interface count.
    interface_joints : dict
        {interface: tuple of its joints}, ``JOINT_STATE`` (all joints) included.

    sensors : dict
        {interface of a sensor: {name: sensor}}, empty unless the driver fills it. A sensor has ``frame`` and
        ``read()``, called at each update, which returns the measurement, or None.

    A driver derives from this, fills the state before and reads the commands after ``ControllerManager.update``.
    """

    def __init__(self, joint_interfaces: Mapping[str, Collection[str]]) -> None:
        """``joint_interfaces``: {joint name: its command interfaces, a collection that may be empty}."""
        self.joint_names = tuple(joint_interfaces)
        self.interface_joints: dict[str, tuple[str, ...]] = {JOINT_STATE: self.joint_names}
        for interface in COMMAND:
            joints = tuple(name for name, interfaces in joint_interfaces.items() if interface in interfaces)
            if joints:
                self.interface_joints[interface] = joints
        for name, interfaces in joint_interfaces.items():
            for interface in interfaces:
                if interface not in COMMAND:
                    raise HardwareError("joint '%s' has the hardware interface '%s'; known are %s"
                                        % (name, interface, ", ".join(COMMAND)))
        self.sensors: dict[str, dict[str, Any]] = {}
        count = len(self.joint_names)
        self._index = {name: i for i, name in enumerate(self.joint_names)}
        self.position = np.zeros(count)
        self.velocity = np.zeros(count)
        self.effort = np.zeros(count)
        self.command = {interface: np.zeros(count) for interface in COMMAND}

    def index(self, interface: str, joints: Iterable[str], asked_by: str) -> npt.NDArray[np.int_]:
        """Indices (k,) of ``joints`` (names). Raises :class:`ControllerError` if one lacks ``interface``; ``asked_by``:
        name of the controller, for the text."""
        offered = self.interface_joints.get(interface)
        if offered is None:
            raise ControllerError(
                "%s needs %s, which no joint of this robot has (it has %s); change the controller's type, or "
                "<hardwareInterface> in the transmissions of the URDF"
                % (asked_by, interface, ", ".join(self.interface_joints)))
        for joint in joints:
            if joint not in offered:
                found = ("it has another hardware interface" if joint in self._index
                         else "the URDF has no transmission for it")
                raise ControllerError("%s: joint '%s' cannot be used through %s: %s; joints with this interface: %s"
                                      % (asked_by, joint, interface, found, ", ".join(offered)))
        return np.array([self._index[joint] for joint in joints], dtype=int)

    # -- a controller that has failed; claims as below ---------------------------------------------------------------

    def hold(self, claims: Mapping[str, Iterable[str]]) -> None:
        """Hold the joints of ``claims``, as far as commands can: their present positions, velocity and effort 0. A
        driver that has brakes uses them."""
        for interface, joints in claims.items():
            if interface in COMMAND:
                index = [self._index[joint] for joint in joints]
                self.command[interface][index] = self.position[index] if interface in POSITIONS else 0.0

    def let_go(self, claims: Mapping[str, Iterable[str]]) -> None:
        """The end of :meth:`hold` for the joints of ``claims``: a controller is about to start on them."""

    # -- a change of controllers; claims are {interface: joints} of each controller ----------------------------------

    def prepare_switch(self, start: Sequence[Mapping[str, Iterable[str]]],
                       stop: Sequence[Mapping[str, Iterable[str]]]) -> bool:
        """Whether the controllers with the claims ``stop`` may give way to those with ``start`` (lists of claims)."""
        return True

    def do_switch(self, start: Sequence[Mapping[str, Iterable[str]]],
                  stop: Sequence[Mapping[str, Iterable[str]]]) -> None:
        """Start the change; called once, between two updates."""

    def switch_result(self, claims: Mapping[str, Iterable[str]] | None = None) -> SwitchResult:
        """A :class:`SwitchResult` for the whole change, or for the resources of one controller's ``claims``."""
        return SwitchResult.DONE
