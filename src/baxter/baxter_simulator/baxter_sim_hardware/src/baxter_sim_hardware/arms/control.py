# SPDX-License-Identifier: BSD-3-Clause
"""Both arms' command modes, as one array of joints.

Each tick turns new commands and the measured joint state into set-points of the joint drives:

- POSITION moves the set-point at no more than speed ratio times the model's velocity limit, with bounded acceleration.
  Joints that one command names move in step: all arrive together with the one that takes longest. The vendor's
  tuck_arms needs this: it ends as soon as the shoulder is folded, and the elbow must have arrived by then.
- VELOCITY is the same profile towards the joint limit ahead, cruising at the commanded speed; so it brakes in time.
- RAW_POSITION follows a stream of set-points directly, without smoothing, braking at its end or a speed ratio:
  set-points are passed on, bounded by the velocity limit and by the acceleration that ideal drives can follow. Behind
  a physical robot's actuators the motors are the bound; set-points go no faster than a motor turns without load.
- TORQUE adds the command to the torque that balances gravity.

In every mode, and in a stop, the effort of a drive stays within the model's limit, including the part that carries the
arm's weight.

Streamed commands (all modes but POSITION) expire joint by joint when they are older than the limb's time-out;
the joint then stops and holds. A command moves only the joints it names. If the command keeps the limb's mode, the
other joints continue with their last command; a command in another mode makes them stop and hold.

A set-point never runs away from its joint: while a joint is pushed or blocked, its set-point stays near, so the arm
returns at the speed of its mode, without a jump.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from baxter_sim_hardware.errors import CommandRefused

from .drives import NO_JOINTS, Drives
from .effort_bounds import REACH_RAD, EffortBounds
from .joint_command import CommandParser, Mode
from .joint_modes import POSITION, RAW_POSITION, JointModes
from .raw_stream import RawStream
from .setpoint import (
    MovingAverage,
    SetPoints,
    Speeds,
    any_beyond,
    approach_rates,
    cruising_speeds,
    follow,
    shares_in_step,
    stopping_point,
)
from .stopping import hardest_stop

if TYPE_CHECKING:
    from collections.abc import Sequence

    from baxter_model.description import LimbModel

    from .joint_command import ArmLimits, CheckedCommand
    from .measured import Measured

COMMAND_TIMEOUT_S = 0.2  # the robot's own
SPEED_RATIO = {"sim": 1.0, "robot": 0.3}  # at start, by profile; 0.3 is what the physical robot starts with

# Acceleration of set-points: the arm can follow it nearly anywhere in its workspace within the effort limits [rad/s^2].
# Joints that hold because their command expired, or because a new one does not name them, decelerate harder; if the
# drives cannot follow, the bound on the set-point's lead applies. When the whole robot stops (disabled, enabled,
# stopped), an arm slows down as hard as its torques allow, within these factors: see `stopping`.
ACCELERATION = {"s0": 10.0, "s1": 10.0, "e0": 15.0, "e1": 15.0, "w0": 40.0, "w1": 40.0, "w2": 40.0}
STOP_ACCELERATION_FACTOR = 3.0
MIN_STOP_FACTOR, MAX_STOP_FACTOR = 0.1, 16.0

UNBOUNDED = 1e9  # [rad/s^2] acceleration of a stream of raw set-points before actuators: they pass in a tick
MIN_SHARE = 0.05  # of its speed that a joint keeps that moves in step with others; so it returns when pushed away
SMOOTHING_S = 0.02  # see setpoint.MovingAverage
AT_LIMIT = 0.999  # fraction of the velocity limit from which torque mode watches the limit
SINK_DAMPING = 150.0  # [Nm s/rad] an unpowered arm with `disabled:=sink` gives way to gravity against this
SINK_FRICTION = 1.0  # [Nm] what still damps a joint whose gravity torque vanishes


class _Limb:
    """The state of one arm that is separate from the other's."""

    def __init__(self, model: LimbModel, limits: ArmLimits) -> None:
        self.parser = CommandParser(limits, model.joint_names)
        self.index = np.array([limits.names.index(name) for name in model.joint_names])
        self.joints = np.zeros(len(limits.names), dtype=bool)  # the same as a mask
        self.joints[self.index] = True
        self.mode = Mode.POSITION  # of the last command
        self.timeout_s = COMMAND_TIMEOUT_S
        self.floats = False
        self.yields = False
        self.balanced = True


class Arms:
    """The joint commands of all limbs, from message fields to drive set-points.

    limbs: sequence of baxter_model.description.LimbModel; limits: ArmLimits of all their joints, which fixes the
    order of every array here; measured: `Measured`, which the caller renews before each tick; speed_ratio: 0..1 at
    start; dt: length of a tick [s]; free_speed: (n,) [rad/s] of the motors of a physical robot's actuators without
    load, or None for ideal drives, which a set-point leads by REACH_RAD at most.
    """

    def __init__(self, limbs: Sequence[LimbModel], limits: ArmLimits, measured: Measured, speed_ratio: float = 1.0,
                 dt: float = 0.002, free_speed: np.ndarray | None = None) -> None:
        self.limits = limits
        is_ideal = free_speed is None
        stream_speed = limits.velocity if is_ideal else free_speed
        # Behind actuators the set-points run ahead, and these bring a joint back that was pushed.
        self._measured, self._reach_rad = measured, REACH_RAD if is_ideal else math.inf
        self._limbs = {limb.side: _Limb(limb, limits) for limb in limbs}
        self._dt = dt
        count = len(limits.names)
        self._all, self._still = np.arange(count), np.zeros(count)
        points = self._points = SetPoints(count)
        points.acceleration[:] = [ACCELERATION[name.rsplit("_", 1)[1]] for name in limits.names]
        points.stopping[:] = points.acceleration
        points.stream_acceleration[:] = points.acceleration if is_ideal else UNBOUNDED
        self._speeds = Speeds(limits.velocity, speed_ratio, stream_speed)
        self._smoothing = MovingAverage(max(1, round(SMOOTHING_S / dt)), measured.position)
        self._modes = JointModes(count)
        self._stream = RawStream(limits, stream_speed, dt)
        self._efforts = EffortBounds(limits.effort)
        self._is_settled = False  # every set-point rests on its target, until the next command or push
        self.reset()

    def reset(self) -> None:
        """Forget every command and hold the measured position: after a reset of the world, or a teleport."""
        everything = np.ones(len(self._all), dtype=bool)
        for limb in self._limbs.values():
            limb.floats = False
        points = self._points
        points.position[:] = points.output[:] = self._measured.position
        points.velocity[:] = points.output_rate[:] = 0.0
        self._smoothing.restart(everything, points.position)
        points.target[:] = self._clamped(points.position)
        self._set_mode(everything, Mode.POSITION)
        self._stream.reset()
        self._refresh_speed()

    def take_over(self) -> None:
        """Forget every command, and put the set-points at the joints' positions and velocities."""
        self.reset()
        self._follow_joint(np.ones(len(self._all), dtype=bool))
        self._is_settled = False

    @property
    def sides(self) -> tuple[str, ...]:
        return tuple(self._limbs)

    @property
    def dt(self) -> float:
        """Length of a tick [s]."""
        return self._dt

    def joints_of(self, side: str) -> np.ndarray:
        """(k,) indices of one limb's joints, torso to wrist."""
        return self._limbs[side].index

    def modes(self, side: str) -> np.ndarray:
        """(k,) the Mode values that one limb's joints are in."""
        return self._modes.mode[self._limbs[side].index]

    @property
    def in_torque(self) -> bool:
        """Whether any joint is in torque mode."""
        return self._modes.any_in_torque

    @property
    def needs_gravity(self) -> bool:
        """Whether drives follow from the torque that balances gravity."""
        return self._modes.any_in_torque or self._efforts.any_yields

    @property
    def in_position_mode(self) -> np.ndarray:
        """(n,) bool, whether the joints are in position mode."""
        return self._modes.mode == POSITION

    @property
    def said_velocity(self) -> np.ndarray:
        """(n,) [rad/s] the feed-forward velocities of joints that follow a stream of raw set-points, else 0."""
        if not self._points.streams.any():
            return self._still
        return np.where(self._points.streams, self._stream.said_velocity(self._measured.time_s), 0.0)

    @property
    def known_gravity(self) -> np.ndarray:
        """(n,) [Nm] the torque that balances gravity, as far as compensation is not suppressed."""
        return self._efforts.balanced * self._measured.gravity

    @property
    def commanded_position(self) -> np.ndarray:
        """(n,) [rad] where the set-points are now."""
        return self._points.output

    @property
    def commanded_velocity(self) -> np.ndarray:
        """(n,) [rad/s] how fast the set-points move now."""
        return self._points.output_rate

    @property
    def commanded_acceleration(self) -> np.ndarray:
        """(n,) [rad/s^2] how fast that changes."""
        return self._points.output_change

    @property
    def commanded_torque(self) -> np.ndarray:
        """(n,) [Nm] what torque mode adds to gravity; zero for joints in other modes."""
        return np.where(self._modes.in_torque, self._modes.value, 0.0)

    # -- settings and commands of clients

    def set_speed_ratio(self, side: str, ratio: float) -> None:
        """Scale POSITION mode's speed; clipped to 0..1. Raises CommandRefused for NaN."""
        if np.isnan(ratio):
            raise CommandRefused("speed ratio is nan; it must be a number from 0 to 1")
        self._speeds.ratio[self._limbs[side].index] = min(max(float(ratio), 0.0), 1.0)
        self._refresh_speed()

    def speed_ratio(self, side: str) -> float:
        return float(self._speeds.ratio[self._limbs[side].index[0]])

    def set_timeout(self, side: str, seconds: float) -> None:
        """How old a streamed command may get [s]. Raises CommandRefused unless it is a positive number."""
        if not seconds > 0.0:
            raise CommandRefused("joint command time-out is %s s; it must be greater than 0" % seconds)
        self._limbs[side].timeout_s = float(seconds)

    def timeout(self, side: str) -> float:
        return self._limbs[side].timeout_s

    def command(self, side: str, mode: int, names: Sequence[str], values: Sequence[float]) -> CheckedCommand:
        """Take one JointCommand message; returns the checked CheckedCommand.

        Raises CommandRefused, in which case nothing has changed.
        """
        limb, points, modes = self._limbs[side], self._points, self._modes
        command = limb.parser.parse(mode, names, values)
        if limb.floats:
            raise CommandRefused("the arm floats, because its cuff is squeezed; release it first")
        if command.mode is Mode.POSITION is limb.mode and modes.all_in_position and not _any(points.braking):
            # The usual case: only the target changes.
            points.target[command.index] = command.values
            self._is_settled = False
            self._move_in_step(command)
            return command
        if command.mode is Mode.RAW_POSITION is limb.mode and not _any(modes.mode[command.index] != RAW_POSITION):
            # A stream goes on: the joints' modes and speeds are as they were.
            self._stream.take(points, modes.mode, command, self._measured.time_s)
            self._expire_later(command, limb)
            self._is_settled = False
            return command
        named = np.zeros(len(self._all), dtype=bool)
        named[command.index] = True
        if limb.mode is not command.mode:
            self._hold(limb.joints & ~named)
            limb.mode = command.mode
        if modes.any_in_torque:
            self._follow_joint(named & modes.in_torque)
        if command.mode is Mode.RAW_POSITION:
            self._stream.take(points, modes.mode, command, self._measured.time_s)
        self._set_mode(named, command.mode)
        if command.mode is Mode.POSITION:
            points.target[command.index] = command.values
            self._move_in_step(command)
        elif command.mode is Mode.VELOCITY:
            ahead = np.where(command.values > 0.0, self.limits.upper[command.index], self.limits.lower[command.index])
            points.target[command.index] = ahead
            modes.value[command.index] = command.values
        elif command.mode is Mode.TORQUE:
            modes.value[command.index] = command.values
        if command.mode is not Mode.POSITION:
            self._expire_later(command, limb)
        self._refresh_speed()
        return command

    def _expire_later(self, command: CheckedCommand, limb: _Limb) -> None:
        self._modes.expire_at(command.index, self._measured.time_s + limb.timeout_s)

    def set_yielding(self, side: str, yields: bool) -> None:
        """Whether a limb, in position and velocity mode, pushes with a fraction of its effort limits only."""
        limb = self._limbs[side]
        if yields != limb.yields:
            limb.yields = yields
            self._efforts.set_yielding(limb.index, yields)

    def wanted_rates(self, side: str) -> np.ndarray:
        """(k,) [rad/s] the speeds at which one limb's joints would move if nothing slowed them.

        0 for joints in modes without collision avoidance.
        """
        points = self._points
        return approach_rates(self._limbs[side].index, points.target, points.position, points.acceleration,
                              self._speeds.nominal, self._modes.is_governed)

    def set_slowing(self, side: str, share: float) -> None:
        """Set the share of the speed, 0 to 1, that a limb's set-points may have in position and velocity mode."""
        index = self._limbs[side].index
        if share != self._speeds.slowing[index[0]]:
            self._speeds.slowing[index] = share
            self._refresh_speed()

    def set_gravity_compensation(self, side: str, on: bool) -> None:
        """Whether a limb's torque mode adds the torque that balances gravity."""
        limb = self._limbs[side]
        if on != limb.balanced:
            limb.balanced = on
            self._efforts.balanced[limb.index] = float(on)

    def set_floating(self, side: str, floats: bool) -> None:
        """Make a limb float without resistance, or hold its present position. It takes no commands while it floats."""
        limb = self._limbs[side]
        if floats == limb.floats:
            return
        limb.floats = floats
        limb.mode = Mode.TORQUE if floats else Mode.POSITION
        if floats:
            self._set_mode(limb.joints, Mode.TORQUE)
            self._refresh_speed()
        else:
            self._hold(limb.joints)

    def floats(self, side: str) -> bool:
        return self._limbs[side].floats

    def feed_forward(self, side: str, velocities: np.ndarray) -> None:
        """Take the velocities (7,) [rad/s] that belong to the raw set-points of this moment.

        A stream of set-points is then followed without the lag of one command. Raises CommandRefused unless there is
        one finite number for each joint.
        """
        index = self._limbs[side].index
        if len(velocities) != len(index) or not np.isfinite(velocities).all():
            raise CommandRefused("inverse dynamics command has velocities %s; it must have %d finite numbers [rad/s]"
                                 % (list(velocities), len(index)))
        self._stream.feed_forward(index, velocities, self._measured.time_s)

    def stop_limb(self, side: str) -> None:
        """Stop one limb's joints and hold them where they come to rest."""
        limb = self._limbs[side]
        limb.mode = Mode.POSITION
        self._hold(limb.joints)

    def hold_here(self, side: str) -> None:
        """Stop one limb's joints and hold them where they are, wherever their set-points were."""
        self._follow_joint(self._limbs[side].joints)
        self.stop_limb(side)

    def stop(self) -> None:
        """Stop every joint as hard as its torques allow, and hold it where it comes to rest."""
        self._follow_joint(self._modes.in_torque)
        stopping = self.stopping()
        for limb in self._limbs.values():
            limb.mode = Mode.POSITION
            limb.floats = False
        self._hold(np.ones(len(self._all), dtype=bool), stopping)

    def stopping(self) -> np.ndarray:
        """(n,) [rad/s^2] deceleration of the set-points in a stop from their present velocities: see `stopping`."""
        points = self._points
        found = np.zeros(len(self._all))
        if points.output_rate.any():
            inertia, bias = self._measured.dynamics(points.output_rate)
            for limb in self._limbs.values():
                own = limb.index
                found[own] = hardest_stop(points.output_rate[own], inertia[np.ix_(own, own)], bias[own],
                                          self.limits.effort[own])
        return np.clip(found, MIN_STOP_FACTOR * points.acceleration, MAX_STOP_FACTOR * points.acceleration)

    # -- one tick

    def update(self) -> Drives:
        """Return the Drives for this tick, from the measured joints."""
        measured, points = self._measured, self._points
        if self._is_settled:
            leads = any_beyond(self._reach_rad, points.output, points.output_rate, measured.position, self._dt)
        else:
            expired = None if measured.missing_s is None else self._modes.expired(measured.missing_s)
            if expired is not None:
                self._hold(expired)
            leads = self._move_set_points()
        if leads:
            self._keep_within_reach()

        bound = self._efforts.bound(measured.gravity, self._modes.mode)
        if self._is_settled or not self._modes.any_in_torque:
            return Drives(self._all, points.output, points.output_rate, bound, NO_JOINTS, NO_JOINTS, NO_JOINTS)
        in_torque = self._modes.in_torque
        self._follow_joint(in_torque)
        pushed = np.flatnonzero(in_torque)
        driven = np.flatnonzero(~in_torque)
        return Drives(driven, points.output[driven], points.output_rate[driven], bound[driven],
                      pushed, *self._torque_drive(pushed))

    def sink(self) -> Drives:
        """Return the Drives for a tick without power: each joint sinks slowly, like a light body in a thick medium.

        The drive pushes with no more than the weight itself.
        """
        self.reset()
        limits, position, gravity = self.limits, self._measured.position, self._measured.gravity
        fall = np.clip(-gravity / SINK_DAMPING, -limits.velocity, limits.velocity)
        at_end = ((position <= limits.lower) & (fall < 0.0)) | ((position >= limits.upper) & (fall > 0.0))
        return Drives(NO_JOINTS, NO_JOINTS, NO_JOINTS, NO_JOINTS,
                      self._all, np.where(at_end, 0.0, fall),
                      np.minimum(np.abs(gravity) + SINK_FRICTION, limits.effort))

    # -- inside

    def _torque_drive(self, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Command plus the torque that balances gravity, as (velocity [rad/s], effort [Nm]), both (k,), with a bounded
        speed.

        A velocity motor with a far target and a bounded effort exerts exactly that effort, and none above the target
        velocity. So the velocity limit also holds within the tick, even for a wrist that 15 Nm would accelerate to 15
        rad/s in one. Where the joint is at its limit without being braked by the command, the motor holds it there.
        """
        velocity = self._measured.velocity[joints]
        gravity = self.known_gravity[joints]
        command = self._modes.value[joints]
        limit = self.limits.velocity[joints]
        total = command + gravity
        at_limit = (np.abs(velocity) > AT_LIMIT * limit) & (command * velocity >= 0.0)
        direction = np.where(at_limit, velocity, total)
        effort = np.where(at_limit, np.inf, np.abs(total))
        return np.copysign(limit, direction), np.minimum(effort, self.limits.effort[joints])

    def _move_set_points(self) -> bool:
        """One tick of the set-points; returns whether any leads its joint by more than it may."""
        points, smoothing = self._points, self._smoothing
        rests, braked, leads = follow(points.numbers, points.flags, smoothing.window, smoothing.oldest,
                                      self._measured.position, self._reach_rad, self._dt)
        smoothing.turn()
        if braked:
            # At the target and at rest: with the weaker acceleration of other motions it would overshoot.
            points.braking &= (points.position != points.target) | (points.velocity != 0.0)
            self._refresh_speed()
        # Nothing to do until the next command or push: every set-point rests on its target.
        if rests and self._modes.all_in_position:
            points.output[:] = points.target
            points.output_change[:] = 0.0
            self._is_settled = True
            self._modes.settle()
        return leads

    def _keep_within_reach(self) -> None:
        points, measured = self._points, self._measured
        # The joints have not made this tick's step yet.
        lead = points.output - points.output_rate * self._dt - measured.position
        far = np.abs(lead) > self._reach_rad
        # In some modes at every tick, and a quarter of the time of numpy's clip.
        offset = np.minimum(np.maximum(lead[far], -self._reach_rad), self._reach_rad) - lead[far]
        points.position[far] += offset
        points.output[far] += offset
        self._smoothing.shift(far, offset)
        self._is_settled = False
        points.velocity[far] = measured.velocity[far]
        points.output_rate[far] = measured.velocity[far]
        # A braking joint that slips stays where it stops; going back would be a motion without a command.
        slipped = far & points.braking
        if _any(slipped):
            points.target[slipped] = self._resting_point()[slipped]

    def _resting_point(self) -> np.ndarray:
        """(n,) [rad] where the set-points come to rest if they brake now."""
        points = self._points
        return self._clamped(stopping_point(points.position, points.velocity, points.stopping))

    def _hold(self, joints: np.ndarray, stopping: np.ndarray | None = None) -> None:
        """Stop the joints in the mask and keep them where they come to rest; stopping: (n,) [rad/s^2]."""
        if not _any(joints):
            return
        points = self._points
        points.stopping[joints] = (STOP_ACCELERATION_FACTOR * points.acceleration if stopping is None
                                   else stopping)[joints]
        self._follow_joint(joints & self._modes.in_torque)
        # Brake from where the drives are now, not from where smoothing would still take them.
        points.position[joints] = points.output[joints]
        points.velocity[joints] = points.output_rate[joints]
        points.target[joints] = self._resting_point()[joints]
        self._set_mode(joints, Mode.POSITION)
        points.braking |= joints
        self._refresh_speed()

    def _follow_joint(self, joints: np.ndarray) -> None:
        """Put the set-points of torque-driven joints at the joints' positions, so that a mode change causes no jump."""
        if joints.any():
            points, measured = self._points, self._measured
            points.position[joints] = points.output[joints] = measured.position[joints]
            points.velocity[joints] = points.output_rate[joints] = measured.velocity[joints]
            self._smoothing.restart(joints, measured.position[joints])

    def _move_in_step(self, command: CheckedCommand) -> None:
        """Make the joints of a POSITION command arrive together."""
        if shares_in_step(command.index, command.values, self._points.position, self._speeds.numbers, MIN_SHARE):
            self._refresh_speed()

    def _set_mode(self, joints: np.ndarray, mode: Mode) -> None:
        self._is_settled = False
        self._speeds.share[joints] = 1.0
        self._modes.set(joints, mode)
        self._points.streams[:] = self._modes.mode == RAW_POSITION
        self._points.braking &= ~joints

    def _clamped(self, position: np.ndarray) -> np.ndarray:
        return np.clip(position, self.limits.lower, self.limits.upper)

    def _refresh_speed(self) -> None:
        """Cruising speed of each joint's set-point [rad/s], by mode."""
        points, modes = self._points, self._modes
        cruising_speeds(self._speeds.numbers, modes.mode, points.braking, modes.value, points.speed)


def _any(mask: np.ndarray) -> bool:
    """Whether any of ``mask``, (n,) bool, is set. numpy's own takes six times as long, and each command asks."""
    return b"\x01" in mask.tobytes()
