# SPDX-License-Identifier: BSD-3-Clause
"""Controllers without a master and without physics: topics as lists, a robot whose joints follow commands."""
from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from loop_ros.node_handle import NodeHandle
from loop_ros.protocol import Log
from loop_ros.testing import FakeLog, FakeRos

from .controller import ControllerContext
from .hardware import RobotHardware
from .interfaces import EFFORT, POSITIONS, VELOCITY


def fake_context(name: str = "controller", parameters: dict[str, Any] | None = None, root_namespace: str = "/robot",
                 robot: Any = None, log: Log | None = None) -> tuple[ControllerContext, FakeRos]:
    """A :class:`ControllerContext` of ``name``; ``parameters``: the controller's own. Returns (context,
    ``loop_ros.testing.FakeRos``)."""
    ros = FakeRos()
    tree = {name: parameters or {}}
    return ControllerContext(name, root_namespace, tree, NodeHandle(ros), log or FakeLog(), robot), ros


class FakeHardware(RobotHardware):
    """Joints that follow commands, with optional faults.

    A position command is reached after ``lag`` (0: in the same tick, towards 1: slower), never beyond ``clip`` [rad];
    ``frozen`` joints never move. A velocity command moves the joint at that velocity, an effort command accelerates it
    with 1 kg m2 or 1 kg.
    """

    def __init__(self, joint_interfaces: Mapping[str, Collection[str]], lag: float = 0.0,
                 clip: float = float("inf")) -> None:
        super().__init__(joint_interfaces)
        self.lag = lag
        self.clip = clip
        self.frozen = False

    def step(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        before = self.position.copy()
        for interface, joints in self.interface_joints.items():
            if interface not in self.command:
                continue
            index = [self.joint_names.index(joint) for joint in joints]
            command = self.command[interface][index]
            if interface == EFFORT:
                self.effort[index] = command
            if self.frozen:
                continue
            if interface in POSITIONS:
                target = command.clip(-self.clip, self.clip)
                self.position[index] += (target - self.position[index]) * (1.0 - self.lag)
            elif interface == VELOCITY:
                self.position[index] += command * dt
            elif interface == EFFORT:
                self.position[index] += (self.velocity[index] + command * dt) * dt
        self.velocity[:] = (self.position - before) / dt
