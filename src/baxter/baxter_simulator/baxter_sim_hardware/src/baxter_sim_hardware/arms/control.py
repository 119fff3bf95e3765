# SPDX-License-Identifier: BSD-3-Clause
"""Both arms' command modes, as one array of joints.

Each tick turns the commands that came in and the measured joint state into what the joint drives shall do:

- POSITION moves the set-point at no more than speed ratio times the model's velocity limit, with bounded acceleration.
- VELOCITY is the same profile towards the joint limit ahead, cruising at the commanded speed; so it brakes in time.
- RAW_POSITION follows a stream of set-points as it is, without smoothing, braking at its end or a speed ratio: what
  arrives is passed on, bounded by the velocity limit and by the acceleration that the drives can follow.
- TORQUE adds the command to the torque that balances gravity.

In every mode the model's effort limit bounds what a drive adds to gravity compensation, which stands outside the clamp:
a shoulder needs up to 57 Nm for the arm's weight alone, more than the 50 Nm that the physical robot's URDF allows it,
and would sink in one posture out of twelve.

Whatever is streamed (all but POSITION) expires joint by joint when its command is older than the limb's time-out;
the joint then stops and holds. A command moves only the joints it names. In the mode that the limb is in already, the
others go on with what they were told; a command in another mode makes them stop and hold.

No set-point runs away from its joint: one that is pushed or blocked keeps its set-point within reach, so the arm comes
back at the speed its mode allows, never with a snap.
"""
from typing import NamedTuple

import numpy as np

from baxter_sim_hardware.errors import CommandRefused

from .joint_command import CommandParser, Mode
from .setpoint import MovingAverage, SetPoints, any_beyond, follow, stopping_point

COMMAND_TIMEOUT_S = 0.2  # the robot's own
SPEED_RATIO = {"sim": 1.0, "robot": 0.3}  # at start, by profile; 0.3 is what the physical robot starts with

# Set-points accelerate by what the arm can follow nearly anywhere in its workspace within the effort limits [rad/s^2].
# A stop decelerates harder, and harder still with the brakes on (disabled or stopped): from full speed, 1.5 rad/s at
# the shoulder and 4 rad/s at the wrist, within 0.015 rad. What the drives cannot follow, the reach bound catches.
ACCELERATION = {"s0": 10.0, "s1": 10.0, "e0": 15.0, "e1": 15.0, "w0": 40.0, "w1": 40.0, "w2": 40.0}
STOP_ACCELERATION_FACTOR = 3.0
BRAKES_ACCELERATION_FACTOR = 16.0
BRAKES_EFFORT_FACTOR = 12.0
BRAKES_REACH_RAD = 4e-3  # in place of REACH_RAD: a joint that brakes at 640 rad/s^2 may be a tick late
# How long brakes push harder than the drives: every joint rests by then. Those that went on would make arms tremble
# that were stopped while they press on something.
BRAKES_S = 0.3

STREAM_GAP_S = 0.05  # raw commands that follow each other within this are one stream
SMOOTHING_S = 0.02  # see setpoint.MovingAverage
# A set-point leads its joint by no more than this [rad]. The joint motors answer an error of that size with what they
# have; a larger one would only make them overshoot. In free motion the joints stay within a tenth of it.
REACH_RAD = 1e-3
AT_LIMIT = 0.999  # fraction of the velocity limit from which torque mode watches the limit
# An arm that touches the robot itself pushes with this share of its effort limits in position and velocity mode.
YIELD_FACTOR = 0.3
FEED_FORWARD_S = 0.05  # for so long a feed-forward velocity belongs to the raw commands that come in
SINK_DAMPING = 150.0  # [Nm s/rad] an unpowered arm with `disabled:=sink` gives way to gravity against this
SINK_FRICTION = 1.0  # [Nm] what still damps a joint whose gravity torque vanishes

# Comparing an array with a member of an enum takes ten times as long.
_POSITION, _VELOCITY, _TORQUE, _RAW_POSITION = (
    int(mode) for mode in (Mode.POSITION, Mode.VELOCITY, Mode.TORQUE, Mode.RAW_POSITION))


class Drives(NamedTuple):
    """What the joint drives shall do in this tick; indices count the joints of the limits.

    servo: indices of joints that follow servo_position [rad] and servo_velocity [rad/s] with up to servo_effort [Nm];
    motor: indices of joints that are pushed towards motor_velocity [rad/s] by no more than motor_effort [Nm].
    """

    servo: np.ndarray
    servo_position: np.ndarray
    servo_velocity: np.ndarray
    servo_effort: np.ndarray
    motor: np.ndarray
    motor_velocity: np.ndarray
    motor_effort: np.ndarray


class _Limb:
    """What one arm does not share with the other."""

    def __init__(self, model, limits):
        self.parser = CommandParser(limits, model.joint_names)
        self.index = np.array([limits.names.index(name) for name in model.joint_names])
        self.mode = Mode.POSITION  # of the last command
        self.speed_ratio = 1.0
        self.timeout_s = COMMAND_TIMEOUT_S
        self.floats = False
        self.yields = False
        self.balanced = True


class Arms:
    """The joint commands of all limbs, from message fields to drive set-points.

    limbs: sequence of baxter_model.description.LimbModel; limits: JointLimits of all their joints, which fixes the
    order of every array here; position: (n,) [rad] where the arms are now; speed_ratio: 0..1 at start;
    dt: length of a tick [s].
    """

    def __init__(self, limbs, limits, position, speed_ratio=1.0, dt=0.002):
        self.limits = limits
        self._limbs = {limb.side: _Limb(limb, limits) for limb in limbs}
        for limb in self._limbs.values():
            limb.speed_ratio = speed_ratio
        self._dt = dt
        count = len(limits.names)
        points = self._points = SetPoints(count)
        self._reference, self._rate, self._target = points.position, points.velocity, points.target
        self._output, self._output_rate = points.output, points.output_rate
        self._braking, self._streams = points.braking, points.streams
        points.acceleration[:] = [ACCELERATION[name.rsplit("_", 1)[1]] for name in limits.names]
        points.stopping[:] = STOP_ACCELERATION_FACTOR * points.acceleration
        self._all = np.arange(count)
        self._none = np.zeros(0, dtype=int)
        self._mode = np.full(count, Mode.POSITION, dtype=int)
        self._value = np.zeros(count)  # last commanded velocity or torque
        self._deadline = np.full(count, np.inf)
        self._may_expire = False
        self._stream_stamp = np.full(count, -np.inf)
        self._brake_ticks = 0  # left, of BRAKES_S
        self._yielding = np.zeros(count, dtype=bool)
        self._any_yields = False
        self._bound = self._bound_gravity = None  # (n,) what drives may exert [Nm], and for which gravity that is
        self._balanced = np.ones(count)  # 1 where torque mode adds the torque that balances gravity, 0 where not
        self._feed_forward = np.zeros(count)  # [rad/s]
        self._feed_forward_stamp = np.full(count, -np.inf)
        self._smoothing = MovingAverage(max(1, round(SMOOTHING_S / dt)), position)
        self.reset(position)

    def reset(self, position):
        """Forget every command and hold `position`, (n,) [rad]: after a reset of the world, or a teleport."""
        everything = np.ones(len(self._mode), dtype=bool)
        for limb in self._limbs.values():
            limb.floats = False
        self._reference[:] = self._output[:] = position
        self._rate[:] = self._output_rate[:] = 0.0
        self._smoothing.restart(everything, self._reference)
        self._target[:] = self._clamped(self._reference)
        self._set_mode(everything, Mode.POSITION)
        # With the clock set back they would seem to have come just now.
        self._stream_stamp[:] = self._feed_forward_stamp[:] = -np.inf
        self._refresh_speed()

    def take_over(self, position, velocity):
        """Forget every command, and have set-points where the joints are and as fast as they move; (n,) measured."""
        self.reset(position)
        self._follow_joint(np.ones(len(self._mode), dtype=bool), position, velocity)
        self._is_settled = False

    @property
    def sides(self):
        return tuple(self._limbs)

    def joints_of(self, side):
        """(k,) indices of one limb's joints, torso to wrist."""
        return self._limbs[side].index

    def modes(self, side):
        """(k,) the Mode values that one limb's joints are in."""
        return self._mode[self._limbs[side].index]

    @property
    def in_torque(self):
        """Whether any joint is in torque mode."""
        return self._any_in_torque

    @property
    def commanded_position(self):
        """(n,) [rad] where the set-points are now."""
        return self._output

    @property
    def commanded_velocity(self):
        """(n,) [rad/s] how fast the set-points move now."""
        return self._output_rate

    @property
    def commanded_torque(self):
        """(n,) [Nm] what torque mode adds to gravity; zero for joints in other modes."""
        return np.where(self._mode == _TORQUE, self._value, 0.0)

    # -- what clients say

    def set_speed_ratio(self, side, ratio):
        """Scale POSITION mode's speed; clipped to 0..1. Raises CommandRefused for NaN."""
        if np.isnan(ratio):
            raise CommandRefused("speed ratio is nan; it must be a number from 0 to 1")
        self._limbs[side].speed_ratio = min(max(float(ratio), 0.0), 1.0)
        self._refresh_speed()

    def speed_ratio(self, side):
        return self._limbs[side].speed_ratio

    def set_timeout(self, side, seconds):
        """How old a streamed command may get [s]. Raises CommandRefused for what is no positive number."""
        if not seconds > 0.0:
            raise CommandRefused("joint command time-out is %s s; it must be greater than 0" % seconds)
        self._limbs[side].timeout_s = float(seconds)

    def timeout(self, side):
        return self._limbs[side].timeout_s

    def command(self, side, mode, names, values, time_s, position, velocity):
        """Take one JointCommand message.

        time_s: now [s]; position, velocity: (n,) measured [rad, rad/s]. Returns the checked JointCommand.
        Raises CommandRefused, in which case nothing has changed.
        """
        limb = self._limbs[side]
        command = limb.parser.parse(mode, names, values)
        if limb.floats:
            raise CommandRefused("the arm floats, because its cuff is squeezed; release it first")
        if command.mode is Mode.POSITION is limb.mode and self._all_in_position and not self._braking.any():
            # As most commands are: nothing changes but where to.
            self._target[command.index] = command.values
            self._is_settled = False
            return command
        named = np.zeros(len(self._mode), dtype=bool)
        named[command.index] = True
        if limb.mode is not command.mode:
            bystander = np.zeros_like(named)
            bystander[limb.index] = True
            self._hold(bystander & ~named, position, velocity)
            limb.mode = command.mode
        if self._any_in_torque:
            self._follow_joint(named & self._in_torque, position, velocity)
        if command.mode is Mode.RAW_POSITION:
            self._stream(command, time_s)
        self._set_mode(named, command.mode)
        if command.mode is Mode.POSITION:
            self._target[command.index] = command.values
        elif command.mode is Mode.VELOCITY:
            ahead = np.where(command.values > 0.0, self.limits.upper[command.index], self.limits.lower[command.index])
            self._target[command.index] = ahead
            self._value[command.index] = command.values
        elif command.mode is Mode.TORQUE:
            self._value[command.index] = command.values
        if command.mode is not Mode.POSITION:
            self._deadline[command.index] = time_s + limb.timeout_s
            self._may_expire = True
        self._refresh_speed()
        return command

    def set_yielding(self, side, yields):
        """Whether a limb, in position and velocity mode, pushes with no more than YIELD_FACTOR of its effort limits."""
        limb = self._limbs[side]
        if yields != limb.yields:
            limb.yields = yields
            self._yielding[limb.index] = yields
            self._any_yields = bool(self._yielding.any())

    def set_gravity_compensation(self, side, on):
        """Whether a limb's torque mode adds the torque that balances gravity."""
        limb = self._limbs[side]
        if on != limb.balanced:
            limb.balanced = on
            self._balanced[limb.index] = float(on)

    def set_floating(self, side, floats, position, velocity):
        """Have a limb float without resistance, or hold where it is then; (n,) measured. It takes no commands while."""
        limb = self._limbs[side]
        if floats == limb.floats:
            return
        joints = np.zeros(len(self._mode), dtype=bool)
        joints[limb.index] = True
        limb.floats = floats
        limb.mode = Mode.TORQUE if floats else Mode.POSITION
        if floats:
            self._set_mode(joints, Mode.TORQUE)
            self._refresh_speed()
        else:
            self._hold(joints, position, velocity)

    def feed_forward(self, side, velocities, time_s):
        """Take the velocities (7,) [rad/s] at which raw set-points move that come in about now.

        A stream of set-points is then followed without the lag of one command. Raises CommandRefused for what is not
        one finite number for each joint.
        """
        index = self._limbs[side].index
        if len(velocities) != len(index) or not np.isfinite(velocities).all():
            raise CommandRefused("inverse dynamics command has velocities %s; it must have %d finite numbers [rad/s]"
                                 % (list(velocities), len(index)))
        limit = self.limits.velocity[index]
        self._feed_forward[index] = np.clip(velocities, -limit, limit)
        self._feed_forward_stamp[index] = time_s

    def stop_limb(self, side, position, velocity):
        """Stop one limb's joints and hold them where they come to rest; (n,) measured."""
        limb = self._limbs[side]
        joints = np.zeros(len(self._mode), dtype=bool)
        joints[limb.index] = True
        limb.mode = Mode.POSITION
        self._hold(joints, position, velocity)

    def stop(self, position, velocity, brakes):
        """Stop every joint and hold it where it comes to rest; (n,) measured.

        brakes: whether the brakes are on from now, which stop harder than the drives alone; until the next stop.
        """
        factor = BRAKES_ACCELERATION_FACTOR if brakes else STOP_ACCELERATION_FACTOR
        self._points.stopping[:] = factor * self._points.acceleration
        self._brake_ticks = round(BRAKES_S / self._dt) if brakes else 0
        for limb in self._limbs.values():
            limb.mode = Mode.POSITION
            limb.floats = False
        self._hold(np.ones(len(self._mode), dtype=bool), position, velocity)

    # -- one tick

    def update(self, time_s, position, velocity, gravity):
        """Drives for the tick that starts at time_s [s].

        position, velocity: (n,) measured [rad, rad/s]; gravity: (n,) [Nm] the torque that balances gravity here.
        """
        if self._is_settled:
            leads = any_beyond(self._reach, self._output, self._output_rate, position, self._dt)
        else:
            if self._may_expire:
                expired = self._deadline <= time_s + 1e-9
                if expired.any():
                    self._hold(expired, position, velocity)
            leads = self._move_reference(position)
        if leads:
            self._keep_within_reach(position, velocity)

        bound = self._effort_bound(gravity)
        self._brake_ticks = max(self._brake_ticks - 1, 0)
        if self._is_settled or not self._any_in_torque:
            return Drives(self._all, self._output, self._output_rate, bound, self._none, self._none, self._none)
        in_torque = self._in_torque
        self._follow_joint(in_torque, position, velocity)
        motor = np.flatnonzero(in_torque)
        servo = np.flatnonzero(~in_torque)
        return Drives(servo, self._output[servo], self._output_rate[servo], bound[servo],
                      motor, *self._torque_drive(motor, velocity[motor], (self._balanced * gravity)[motor]))

    def sink(self, position, velocity, gravity):
        """Drives for a tick without power: each joint gives way to gravity like a light body in a thick medium.

        position, velocity, gravity: (n,) as in `update`. The drive pushes with no more than the weight itself.
        """
        self.reset(position)
        limits = self.limits
        fall = np.clip(-gravity / SINK_DAMPING, -limits.velocity, limits.velocity)
        at_end = ((position <= limits.lower) & (fall < 0.0)) | ((position >= limits.upper) & (fall > 0.0))
        return Drives(self._none, self._none, self._none, self._none,
                      self._all, np.where(at_end, 0.0, fall), np.abs(gravity) + SINK_FRICTION)

    # -- inside

    def _torque_drive(self, joints, velocity, gravity):
        """Command plus what balances gravity, as a motor's (velocity [rad/s], effort [Nm]), both (k,); it never races.

        A velocity motor with a far target and a bounded effort exerts exactly that effort, and none beyond the target:
        the velocity limit comes for free and holds within the tick, also for a wrist that 15 Nm would bring to 15 rad/s
        in one. Where the joint is at its limit without being braked by the command, the motor holds it there.
        """
        command = self._value[joints]
        limit = self.limits.velocity[joints]
        total = command + gravity
        at_limit = (np.abs(velocity) > AT_LIMIT * limit) & (command * velocity >= 0.0)
        direction = np.where(at_limit, velocity, total)
        effort = np.where(at_limit, self.limits.effort[joints] + np.abs(gravity), np.abs(total))
        return np.copysign(limit, direction), effort

    def _stream(self, command, time_s):
        """Take a raw set-point: its target moves there at the stream's own pace, or is there at once if none runs."""
        index = command.index
        gap = np.maximum(time_s - self._stream_stamp[index], self._dt)
        goes_on = (self._mode[index] == _RAW_POSITION) & (gap <= STREAM_GAP_S)
        self._target[index] = np.where(goes_on, self._target[index], command.values)
        limit = self.limits.velocity[index]
        # With a feed-forward velocity the goal is where the next command will be, without the one that has just come.
        is_fresh = goes_on & (time_s - self._feed_forward_stamp[index] <= FEED_FORWARD_S)
        ahead = np.where(is_fresh, self._feed_forward[index] * np.minimum(gap, STREAM_GAP_S), 0.0)
        goal = np.clip(command.values + ahead, self.limits.lower[index], self.limits.upper[index])
        self._points.pace[index] = np.clip((goal - self._target[index]) / gap, -limit, limit)
        self._points.goal[index] = goal
        self._stream_stamp[index] = time_s

    @property
    def _reach(self):
        return BRAKES_REACH_RAD if self._brake_ticks else REACH_RAD

    def _effort_bound(self, gravity):
        """(n,) [Nm] what drives may exert where `gravity` (n,) is what the weight takes of it."""
        if self._brake_ticks:
            return BRAKES_EFFORT_FACTOR * self.limits.effort + np.abs(gravity)
        if gravity is not self._bound_gravity:
            self._bound_gravity, self._bound = gravity, self.limits.effort + np.abs(gravity)
        if self._any_yields:
            gentle = self._yielding & (self._mode != _RAW_POSITION)
            return np.where(gentle, YIELD_FACTOR * self.limits.effort + np.abs(gravity), self._bound)
        return self._bound

    def _move_reference(self, position):
        """One tick of the set-points; returns whether any leads its joint, measured at (n,), by more than it may."""
        smoothing = self._smoothing
        rests, braked, leads = follow(self._points.numbers, self._points.flags, smoothing.window, smoothing.oldest,
                                      position, self._reach, self._dt)
        smoothing.turn()
        if braked:
            # At the target and at rest: with the weaker acceleration of other motions it would overshoot.
            self._braking &= (self._reference != self._target) | (self._rate != 0.0)
            self._refresh_speed()
        # Nothing to do until the next command or push: every set-point rests on its target.
        if rests and self._all_in_position:
            self._output[:] = self._target
            self._is_settled = True
            self._may_expire = False
        return leads

    def _keep_within_reach(self, position, velocity):
        # The joints have not made this tick's step yet.
        reach = self._reach
        lead = self._output - self._output_rate * self._dt - position
        far = np.abs(lead) > reach
        offset = np.clip(lead[far], -reach, reach) - lead[far]
        self._reference[far] += offset
        self._output[far] += offset
        self._smoothing.shift(far, offset)
        self._is_settled = False
        self._rate[far] = velocity[far]
        self._output_rate[far] = velocity[far]
        # What brakes and slips stays where it stops; going back would be a motion that nobody asked for.
        slipped = far & self._braking
        self._target[slipped] = self._resting_point()[slipped]

    def _resting_point(self):
        """(n,) [rad] where the set-points come to rest if they brake now."""
        return self._clamped(stopping_point(self._reference, self._rate, self._points.stopping))

    def _hold(self, joints, position, velocity):
        """Stop the joints in the mask and keep them where they come to rest."""
        if not joints.any():
            return
        self._follow_joint(joints & self._in_torque, position, velocity)
        # Brake from where the drives are now, not from where smoothing would still take them.
        self._reference[joints] = self._output[joints]
        self._rate[joints] = self._output_rate[joints]
        self._target[joints] = self._resting_point()[joints]
        self._set_mode(joints, Mode.POSITION)
        self._braking |= joints
        self._refresh_speed()

    def _follow_joint(self, joints, position, velocity):
        """Put the set-points of joints that were driven by torque onto the joints themselves: no jump on return."""
        if joints.any():
            self._reference[joints] = self._output[joints] = position[joints]
            self._rate[joints] = self._output_rate[joints] = velocity[joints]
            self._smoothing.restart(joints, position[joints])

    def _set_mode(self, joints, mode):
        self._is_settled = False
        self._mode[joints] = mode
        self._streams[:], self._in_torque = self._mode == _RAW_POSITION, self._mode == _TORQUE
        self._any_in_torque, self._all_in_position = bool(self._in_torque.any()), bool((self._mode == _POSITION).all())
        self._value[joints] = 0.0
        self._deadline[joints] = np.inf
        self._braking &= ~joints

    def _clamped(self, position):
        return np.clip(position, self.limits.lower, self.limits.upper)

    def _refresh_speed(self):
        """Cruising speed of each joint's set-point [rad/s], by mode."""
        speed = self._points.speed
        speed[:] = self.limits.velocity
        for limb in self._limbs.values():
            if limb.speed_ratio != 1.0:
                profiled = limb.index[(self._mode[limb.index] == _POSITION) & ~self._braking[limb.index]]
                speed[profiled] *= limb.speed_ratio
        in_velocity = self._mode == _VELOCITY
        if in_velocity.any():
            speed[in_velocity] = np.abs(self._value[in_velocity])
