# SPDX-License-Identifier: BSD-3-Clause
"""The joints of a simulated model as hardware for controllers: state in, limits, drives out. ROS-free."""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from controller_manager.errors import ControllerError, HardwareError
from controller_manager.hardware import RobotHardware
from controller_manager.interfaces import COMMAND, EFFORT, POSITIONS, VELOCITY
from controller_manager.limits import (
    EffortLimiter,
    PositionLimiter,
    VelocityLimiter,
    limits_from_urdf,
    with_parameters,
    without_idle_soft_limits,
)
from controller_manager.pid import Gains, Pid
from controller_manager.transmissions import read_soft_limits, read_transmissions

if TYPE_CHECKING:
    from bullet_sim import Model
    from loop_ros.protocol import Log
    from urdf_model import Robot

# Practically unlimited effort [N m, N]: Gazebo's position interface is kinematic, and descriptions with link inertias
# of 10 kg m2 and motors of 100 N m rely on it.
_UNLIMITED = 1e9

_LIMITERS = {**dict.fromkeys(POSITIONS, PositionLimiter), VELOCITY: VelocityLimiter, EFFORT: EffortLimiter}


class SimulatedHardware(RobotHardware):
    """The joints of a ``bullet_sim.Model`` that have a transmission.

    Commands act on the joint, as in Gazebo; mechanicalReduction and offset have no effect. Per interface:

    position, with or without velocity and acceleration
        the joint is at the command after the step, with unlimited effort. On a free-standing model only the load acts
        on the base, not the reaction of the motion: in Gazebo this interface is kinematic, and descriptions with very
        light links rely on it
    position with PID gains
        the effort is the PID's output of the position error, at most the effort limit
    velocity
        a motor keeps the velocity with at most the effort limit; with PID gains, the PID's output as an effort
    effort
        the effort acts

    A velocity or an effort of 0 is written once and not again, so that another plugin may drive a joint whose interface
    no controller uses. A velocity of 0 holds the joint until then.

    Until the first command joints with a position interface stay where they were spawned.
    """

    def __init__(self, model: Model, robot: Robot, urdf_xml: str, log: Log, limit_parameters: Any = None,
                 gain_parameters: Any = None, namespace: str = "") -> None:
        """``robot``, ``urdf_xml``: the description that names transmissions and limits. ``limit_parameters``,
        ``gain_parameters``: {joint: ...} the parameters under ``joint_limits`` and ``gazebo_ros_control/pid_gains`` of
        ``namespace``. ``log``: ``warn`` and ``error`` of one text. Raises :class:`HardwareError`.
        """
        joints, warnings = read_transmissions(urdf_xml, model.joint_names)
        for warning in warnings:
            log.warn(warning)
        super().__init__({joint.name: (joint.interface,) for joint in joints})
        self.joints = joints
        self._model = model
        self._model_index = model.index(self.joint_names)
        soft = read_soft_limits(urdf_xml)
        limits = [self._limits_of(robot.joints[joint.name], soft, limit_parameters, namespace, log)
                  for joint in joints]
        self._groups = []
        for interface in COMMAND:
            here = [i for i, joint in enumerate(joints) if joint.interface == interface]
            gains = {} if interface == EFFORT else self._gains_of(here, gain_parameters, namespace, log)
            self._add_group(interface, [i for i in here if i not in gains], limits, None)
            self._add_group(interface, list(gains), limits, list(gains.values()))
        self._continuous = np.array([robot.joints[name].type == "continuous" for name in self.joint_names], dtype=bool)
        self._frozen = None
        # (n,) whether joints are held by their brakes (rare); the held positions; the strength of the brakes.
        self._held = None
        self._held_at, self._brakes = np.zeros(len(joints)), np.full(len(joints), _UNLIMITED)
        self.read()
        self.joints_set()

    def read(self) -> None:
        """Take the model's joint state, as it is after the last physics step."""
        for ours, theirs in zip((self.position, self.velocity, self.effort), self._model.read_joints(), strict=True):
            ours[:] = theirs[self._model_index]
        for group in self._groups:
            group.read()

    def write(self, dt: float) -> None:
        """Drive the model's joints for the next physics step of ``dt`` seconds."""
        for group in self._groups:
            index = group.index
            command = self.command[group.interface][index]
            if self._frozen is not None:
                command = self._frozen[index] if group.interface in POSITIONS else np.zeros(len(index))
            position, velocity = self.position[index], self.velocity[index]
            group.drive(group.limiter.enforce(command, dt, position, velocity), position, velocity, dt)
        if self._held is not None:
            held = self._held
            self._model.drive_position(self._model_index[held], self._held_at[held], self._brakes[held])

    def hold(self, claims: Mapping[str, Iterable[str]]) -> None:
        """Hold the joints of ``claims`` with brakes, against any load."""
        super().hold(claims)
        index = self._braked(claims)
        if index:
            self._held = np.zeros(len(self.joint_names), dtype=bool) if self._held is None else self._held
            self._held_at[index] = self.position[index]
            self._held[index] = True

    def let_go(self, claims: Mapping[str, Iterable[str]]) -> None:
        if self._held is not None:
            self._held[self._braked(claims)] = False
            # The next commands take the brakes off, zeros too.
            for group in self._groups:
                group.write_all()
            self._held = self._held if self._held.any() else None

    def hold_all(self) -> None:
        """As :meth:`hold`, for all joints."""
        self.hold(self.interface_joints)

    def joints_set(self) -> None:
        """The joints were moved by a service, or spawned: hold them there, and apply limits from there."""
        self.read()
        for interface in POSITIONS:
            self.command[interface][:] = self.position
        self.command[VELOCITY][:] = 0.0
        self.command[EFFORT][:] = 0.0
        if self._frozen is not None:
            self._frozen = self.position.copy()
        self._held_at = self.position.copy()
        for group in self._groups:
            group.reset()

    def _braked(self, claims):
        """Indices of the joints of ``claims`` that a command cannot hold."""
        joints = {joint for interface in (VELOCITY, EFFORT) for joint in claims.get(interface, ())}
        return [i for i, name in enumerate(self.joint_names) if name in joints]

    def stop(self, stopped: bool) -> None:
        """Emergency stop: while ``stopped``, joints hold the positions that they had when it came."""
        if stopped and self._frozen is None:
            self._frozen = self.position.copy()
        elif not stopped:
            self._frozen = None

    @property
    def pids(self) -> list[tuple[Pid, list[str]]]:
        """List of (:class:`controller_manager.pid.Pid`, its joints' names) of the joints that are driven by one."""
        return [(group.pid, [self.joint_names[i] for i in group.index]) for group in self._groups
                if isinstance(group, _PidGroup)]

    # -- inside -------------------------------------------------------------------------------------------------

    @staticmethod
    def _limits_of(joint, soft, parameters, namespace, log):
        limits = limits_from_urdf(joint, soft.get(joint.name))
        values = (parameters or {}).get(joint.name) if isinstance(parameters, dict) else None
        if values is not None:
            limits = with_parameters(limits, values, "%s/joint_limits/%s" % (namespace, joint.name))
        kept = without_idle_soft_limits(limits)
        if kept is not limits:
            log.warn("joint '%s' has a <safety_controller> but no limit of velocity, so its soft limits are not "
                     "enforced; give velocity=\"...\" in its <limit>, or %s/joint_limits/%s/{has_velocity_limits: "
                     "true, max_velocity: ...}" % (joint.name, namespace, joint.name))
        return kept

    def _gains_of(self, indices, parameters, namespace, log):
        """{index: Gains} of the joints that have PID gains; incomplete ones are reported and left out."""
        found = {}
        source = "%s/gazebo_ros_control/pid_gains" % namespace
        for i in indices:
            name = self.joint_names[i]
            if not isinstance(parameters, dict) or name not in parameters:
                continue
            values = parameters[name] if isinstance(parameters[name], dict) else {}

            def read(entry, values=values):
                return values.get(entry.rpartition("/")[2]), "%s/%s" % (source, entry)

            try:
                found[i] = Gains.from_params(read, [name])
            except ControllerError as error:
                log.error("joint '%s' is driven without PID: %s" % (name, error))
        return found

    def _add_group(self, interface, indices, limits, gains):
        if not indices:
            return
        limiter = _LIMITERS[interface]([limits[i] for i in indices])
        effort = np.array([min(limits[i].effort, _UNLIMITED) for i in indices])
        index, model_index = np.array(indices), self._model_index[indices]
        if gains is not None:
            self._groups.append(_PidGroup(self, interface, index, model_index, limiter, effort, Gains.joined(gains)))
        else:
            kind = _CarriedGroup if interface in POSITIONS and not self._model.static else _GROUPS[interface]
            self._groups.append(kind(self, interface, index, model_index, limiter, effort))


class _Group:
    """Joints of one interface that are driven the same way. ``index`` is into the hardware's arrays."""

    def __init__(self, hardware: SimulatedHardware, interface: str, index: np.ndarray, model_index: np.ndarray,
                 limiter: PositionLimiter | VelocityLimiter | EffortLimiter, effort: np.ndarray) -> None:
        self.interface = interface
        self.index = index
        self.limiter = limiter
        self._hardware = hardware
        self._model = hardware._model
        self._model_index = model_index
        self._effort = effort

    def read(self) -> None:
        """Correct the model's state of these joints where PyBullet does not know it."""

    def reset(self) -> None:
        self.limiter.reset()
        self.write_all()

    def write_all(self) -> None:
        """Write the next commands, whatever they are."""


class _PositionGroup(_Group):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._unlimited = np.full(len(self.index), _UNLIMITED)

    def drive(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray, dt: float) -> None:
        # The velocity that reaches the command in this step; stable at any inertia, because the solver computes the
        # effort.
        self._model.drive_velocity(self._model_index, (command - position) / dt, self._unlimited)


class _CarriedGroup(_Group):
    """Position interface on a free-standing model."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._velocity = np.zeros(len(self.index))

    def read(self) -> None:
        # In the physics these joints have no velocity, since they are repositioned.
        self._hardware.velocity[self.index] = self._velocity

    def reset(self) -> None:
        super().reset()
        self._velocity[:] = 0.0

    def drive(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray, dt: float) -> None:
        self._velocity = (command - position) / dt
        self._model.carry(self._model_index, command)


class _YieldingGroup(_Group):
    """Only the first of several zeros is written."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._due = np.ones(len(self.index), dtype=bool)  # joints whose next command is written even if it is 0

    def write_all(self) -> None:
        self._due[:] = True

    def drive(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray, dt: float) -> None:
        acts = command != 0.0
        written, self._due = acts | self._due, acts
        if written.all():
            self._write(self._model_index, command, self._effort)
        elif written.any():
            self._write(self._model_index[written], command[written], self._effort[written])

    def _write(self, model_index: np.ndarray, command: np.ndarray, effort: np.ndarray) -> None:
        raise NotImplementedError


class _VelocityGroup(_YieldingGroup):
    def _write(self, model_index: np.ndarray, command: np.ndarray, effort: np.ndarray) -> None:
        self._model.drive_velocity(model_index, command, effort)


class _EffortGroup(_YieldingGroup):
    def _write(self, model_index: np.ndarray, command: np.ndarray, effort: np.ndarray) -> None:
        self._model.drive_effort(model_index, command)


class _PidGroup(_Group):
    def __init__(self, hardware: SimulatedHardware, interface: str, index: np.ndarray, model_index: np.ndarray,
                 limiter: PositionLimiter | VelocityLimiter | EffortLimiter, effort: np.ndarray, gains: Gains) -> None:
        super().__init__(hardware, interface, index, model_index, limiter, effort)
        self.pid = Pid(gains)

    def reset(self) -> None:
        super().reset()
        self.pid.reset()

    def drive(self, command: np.ndarray, position: np.ndarray, velocity: np.ndarray, dt: float) -> None:
        if self.interface in POSITIONS:
            error = command - position
            around = self._hardware._continuous[self.index]
            if around.any():
                error = np.where(around, np.remainder(error + math.pi, 2.0 * math.pi) - math.pi, error)
        else:
            error = command - velocity
        effort = self.pid.update(error, dt)
        self._model.drive_effort(self._model_index, np.minimum(np.maximum(effort, -self._effort), self._effort))


_GROUPS = {**dict.fromkeys(POSITIONS, _PositionGroup), VELOCITY: _VelocityGroup, EFFORT: _EffortGroup}

__all__ = ["HardwareError", "SimulatedHardware"]
