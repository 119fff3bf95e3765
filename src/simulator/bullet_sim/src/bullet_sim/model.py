# SPDX-License-Identifier: BSD-3-Clause
"""One robot or object in the world: its joints as arrays, its links by name."""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING

import numpy as np

from command_line.options import counted
from urdf_model import bounds

from .body import Body
from .damping import JointDamping
from .errors import BulletSimError, within
from .loops import close_loops
from .multibodies import MultibodyState
from .pose import Pose
from .quiet_pybullet import pybullet
from .springs import JointSprings
from .state_watch import ImpossibleState, out_of_bounds

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike

    from urdf_model import Joint

    from .builder import Blueprint
    from .multibodies import Multibodies
    from .world import World

# Bullet's joint motor reaches its target as velocity = gain * error / time step. With 20 solver iterations a gain of
# 0.5 holds Baxter's arms within 5e-5 rad for 0.11 ms a step; the default of 0.1 sags by 2.4e-4 rad.
POSITION_GAIN = 0.5

# Stands for "as strong as need be" [N m, N].
_RIGID_EFFORT = 1e9

# If the sum of the squares of all numbers is at most this, each number is far within its bound.
_SURELY_FINE = 1e10
_LIGHT = 1e-20  # of efforts, which have no bound

# A joint faster than this [rad/s, m/s] may pass its limit between two steps: Bullet notices a limit only when the joint
# is beyond it. At 100 the joint gets 0.2 beyond, and Bullet corrects only a part at each step; slower joints get at
# most 0.01 beyond.
_QUICK = 5.0

# Largest force of the gear between coupled joints [N, Nm]: more than any drive of a finger.
_GEAR_FORCE = 1000.0


class Model(Body):
    """Made by ``World.spawn``. All arrays over joints are in the order of ``joint_names``; SI units and radians.

    A drive holds until another one replaces it, except efforts, which last one step.
    """

    def __init__(self, client: int, world: World, blueprint: Blueprint, parts: Multibodies,
                 root_offsets: list[np.ndarray]) -> None:
        super().__init__(client, world, blueprint, parts, root_offsets)
        self._gravity_key = None
        self._turned_gravity = None
        joints = list(self.merged.joints.values())
        self.joint_names = tuple(joint.name for joint in joints)
        self._index = {joint.name: i for i, joint in enumerate(joints)}
        self.lower = _column(joints, "lower", -math.inf)
        self.upper = _column(joints, "upper", math.inf)
        self.max_velocity = _column(joints, "velocity", math.inf)
        self.max_effort = _column(joints, "effort", math.inf)
        count = len(joints)
        self._all = list(range(count))
        self._packing = struct.Struct("%dd" % (3 * count))
        # Of the last `drive_position` of some joints, as bytes, if no other drive of one of them has come since: the
        # joints -> (their numbers, the rest).
        self._told: dict[bytes, tuple[frozenset[int], list[bytes | None]]] = {}
        self._reading, self._read_at = None, -1  # the last result of `read_joints`, and the number of steps then
        self._sizes = 0.0, 0.0, 0.0  # lengths of Bullet's vectors of positions, velocities and efforts then
        self._effort_driven, self._any_effort_driven = np.zeros(count, dtype=bool), False
        self._commanded_effort = np.zeros(count)
        self._zeros = [0.0] * count
        self._gears: dict[tuple[int, int], int] = {}  # of (joint, other), by index
        self._couplings: dict[tuple[int, int], float] = {}  # of the same -> ratio
        self._loops = close_loops(client, self.merged, parts)
        self._damping = JointDamping(self, client, world.time_step_s, {
            index: within(bounds.DAMPING, joint.damping, "the damping of joint '%s'" % joint.name)
            for index, joint in enumerate(joints) if joint.damping > 0.0})
        self._friction = np.array([joint.friction for joint in joints])
        #: None, or the springs of its joints; the world lets them act in each step.
        self.springs = None
        if any(joint.spring_stiffness for joint in joints):
            self.springs = JointSprings(self, joints, self._damping.felt_inertia(), world.time_step_s)
        if count:
            self.release(np.arange(count))
        self.mark_start()

    # -- joints -------------------------------------------------------------------------------------------------

    def index(self, names: Iterable[str]) -> np.ndarray:
        """Return the indices (int array) of joints given by name. Raises BulletSimError that lists the known ones."""
        try:
            return np.array([self._index[name] for name in names], dtype=int)
        except KeyError as error:
            raise BulletSimError(
                "model '%s' has no joint %s; its joints are %s" % (self.name, error, ", ".join(self.joint_names))
            ) from None

    def read_joints(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return positions, velocities and efforts, three (n,) read-only arrays, as they are after the last step.

        The effort is what the drive applied during the last step.
        """
        # Cached, because control, publishers and the snapshot all call it in a tick.
        if self._reading is None or self._read_at != self._world.steps:
            self._reading, self._read_at = self._read(), self._world.steps
        return self._reading

    def _read(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if not self._all:
            return np.empty(0), np.empty(0), np.empty(0)
        position, velocity, _, effort = zip(*self.parts.joint_states(), strict=True)
        # In a third of the time of numpy's dot.
        self._sizes = math.hypot(*position), math.hypot(*velocity), math.hypot(*effort)
        # In a third of the time that np.array takes for tuples.
        position, velocity, effort = np.frombuffer(self._packing.pack(*position, *velocity, *effort)).reshape(3, -1)
        if self._any_effort_driven:
            # Bullet's reading does not include explicit torques.
            effort = np.where(self._effort_driven, self._commanded_effort, effort)
            effort.setflags(write=False)
        return position, velocity, effort

    def drive_position(self, index: np.ndarray, position: np.ndarray, max_effort: np.ndarray,
                       velocity: np.ndarray | None = None) -> None:
        """Pull joints ``index`` (k,) to ``position`` (k,) with at most ``max_effort`` (k,).

        Bullet solves the motor with the other constraints (implicitly), so a stiff drive is stable.

        ``position`` is the set-point at the end of the step. With ``velocity`` (k,), the set-point's own velocity, a
        moving set-point is followed without lag.
        """
        joints = index.tobytes()
        told = [None if values is None else values.tobytes() for values in (position, max_effort, velocity)]
        before = self._told.get(joints)
        if before is not None and before[1] == told:
            return  # Bullet's motors keep what they were told, and joints at rest are told the same at each tick
        self._drive_otherwise(index)
        gains = len(index)
        if velocity is not None:
            # The motor adds the velocity to what closes the gap, so the gap is the one at the beginning of the step.
            position = position - velocity * self._world.time_step_s
        targets = position.tolist()
        self._refuse_nan(index, targets, "position")
        self.parts.command(
            index,
            pybullet.POSITION_CONTROL,
            targetPositions=targets,
            targetVelocities=[0.0] * gains if velocity is None else velocity.tolist(),
            forces=max_effort.tolist(),
            positionGains=[POSITION_GAIN] * gains,
            velocityGains=[1.0] * gains,
        )
        if before is None:
            self._forget(index)
        self._told[joints] = (frozenset(index.tolist()) if before is None else before[0], told)

    def drive_velocity(self, index: np.ndarray, velocity: np.ndarray, max_effort: np.ndarray) -> None:
        """Keep joints ``index`` (k,) at ``velocity`` (k,) with at most ``max_effort`` (k,)."""
        self._forget(index)
        self._drive_otherwise(index)
        targets = velocity.tolist()
        self._refuse_nan(index, targets, "velocity")
        self.parts.command(index, pybullet.VELOCITY_CONTROL, targetVelocities=targets, forces=max_effort.tolist())

    def carry(self, index: np.ndarray, position: np.ndarray, velocity: np.ndarray | None = None) -> None:
        """Put joints ``index`` (k,) at ``position`` (k,) and hold them there during the next step, with unlimited
        force. With ``velocity`` (k,) they move at it during the step.

        They move without inertia: links before the joint feel no reaction, as with Gazebo's ``Joint::SetPosition``.
        Links behind it, and touched bodies, do.
        """
        places = position.tolist()
        self._refuse_nan(index, places, "position")
        self._drive_otherwise(index)
        velocity = np.zeros(len(index)) if velocity is None else velocity
        speeds = velocity.tolist()
        self._refuse_nan(index, speeds, "velocity")
        self.parts.put(index, places, speeds)
        self._reading = None
        self.drive_velocity(index, velocity, np.full(len(index), _RIGID_EFFORT))

    def drive_effort(self, index: np.ndarray, effort: np.ndarray) -> None:
        """Apply ``effort`` (k,) to joints ``index`` (k,) during the next step; call it again for every step.

        Efforts are clamped to ``bounds.EFFORT``; raises BulletSimError for NaN.
        """
        self._refuse_nan(index, effort.tolist(), "effort")
        # At every tick, and a third of the time of numpy's clip.
        effort = np.minimum(np.maximum(effort, bounds.EFFORT.low), bounds.EFFORT.high)
        if not self._effort_driven[index].all():
            self.release(index)
            self._effort_driven[index] = self._any_effort_driven = True
        self._commanded_effort[index] = effort
        self._reading = None
        self.parts.command(index, pybullet.TORQUE_CONTROL, forces=effort.tolist())

    def add_effort(self, index: np.ndarray, effort: np.ndarray) -> None:
        """Apply ``effort`` (k,) to joints ``index`` (k,) during the next step, in addition to their drives.

        Raises BulletSimError out of bounds.
        """
        within(bounds.EFFORT, effort, "the effort on a joint of '%s'" % self.name)
        self.wake()
        self.parts.command(index, pybullet.TORQUE_CONTROL, forces=effort.tolist())

    def limited_effort(self, index: np.ndarray, effort: np.ndarray) -> np.ndarray:
        """Return ``effort`` (k,) on joints ``index`` (k,) as Gazebo cuts it: to the effort limits, and to nothing
        where it would speed up a joint that is beyond its velocity limit."""
        speed = self.read_joints()[1][index]
        too_fast = (np.abs(speed) > self.max_velocity[index]) & (effort * speed > 0.0)
        return np.where(too_fast, 0.0, np.clip(effort, -self.max_effort[index], self.max_effort[index]))

    def set_damping(self, index: int, damping: float) -> None:
        """Set the viscous damping of joint ``index`` [Nm s/rad or N s/m], as far as the tick's length allows it.

        Raises BulletSimError out of bounds.
        """
        within(bounds.DAMPING, damping, "the damping of joint '%s'" % self.joint_names[index])
        self._damping.set(index, damping)

    def set_inertial(self, body: str, mass: float, inertia: ArrayLike, centre: ArrayLike | None = None) -> None:
        super().set_inertial(body, mass, inertia, centre)
        if self._link_index[body] >= 0:
            self._damping.restore_inertia(self._link_index[body])

    @property
    def damping(self) -> np.ndarray:
        """(n,) The viscous damping of the joints as it acts [Nm s/rad or N s/m]."""
        return self._damping.values

    def step_changed(self) -> None:
        """For World: the length of a tick has changed."""
        self._told.clear()  # Bullet turns the greatest effort into an impulse of a tick
        self._damping.step_changed(self._world.time_step_s)
        if self.springs is not None:
            self.springs.step_changed(self._world.time_step_s)

    def set_limits(self, index: int, lower: float, upper: float) -> None:
        """Set the limits of joint ``index`` [rad or m]. Raises BulletSimError if ``lower`` is not below ``upper``."""
        if not lower < upper:
            raise BulletSimError("a lower limit of %g is not below the upper limit %g" % (lower, upper))
        for limit, what in ((lower, "lower"), (upper, "upper")):
            if math.isfinite(limit):
                within(bounds.JOINT_POSITION, limit, "the %s limit of joint '%s'" % (what, self.joint_names[index]))
        pybullet.changeDynamics(
            *self.parts.places[index], jointLowerLimit=lower, jointUpperLimit=upper, physicsClientId=self._client
        )
        self.lower[index], self.upper[index] = lower, upper

    def couple(self, joint: int, other: int, ratio: float) -> None:
        """Couple two joints by a permanent gear: ``other`` moves ``ratio`` times as far as ``joint``.

        A drive on one of them drives both. Another call for the same joints changes nothing.
        """
        pair = int(joint), int(other)
        if self.parts.places[pair[0]].body != self.parts.places[pair[1]].body:
            # Bullet's gear between two multibodies pulls the second one the wrong way where the ratio is negative.
            self.blueprint = self.blueprint._replace(in_limbs=False)
            self._rebuild()
        if pair not in self._gears:
            self._gears[pair] = pybullet.createConstraint(
                *self.parts.places[pair[0]], *self.parts.places[pair[1]],
                pybullet.JOINT_GEAR, (0, 0, 1), (0, 0, 0), (0, 0, 0), physicsClientId=self._client,
            )
        gear = self._gears[pair]
        self._couplings[pair] = ratio
        pybullet.changeConstraint(
            gear, gearRatio=-1.0 / ratio, erp=POSITION_GAIN, maxForce=_GEAR_FORCE, physicsClientId=self._client
        )

    def release(self, index: np.ndarray) -> None:
        """Switch the motors of joints ``index`` (k,) off; the joints' friction (Coulomb's) remains."""
        friction = self._friction[index]
        self.drive_velocity(index, np.zeros(len(index)), friction)
        if friction.any():
            # Bullet's reading of its motor is the friction, which no drive applies.
            rough = index[friction > 0.0]
            self._effort_driven[rough] = self._any_effort_driven = True
            self._commanded_effort[rough], self._reading = 0.0, None

    def set_joint_positions(self, index: Sequence[int] | np.ndarray, position: np.ndarray,
                            velocity: np.ndarray | None = None) -> None:
        """Put joints ``index`` (k,) at ``position`` (k,) at once, at rest or at ``velocity`` (k,). Nothing in between
        is simulated.

        Raises BulletSimError out of bounds.
        """
        if len(index) != len(position):
            raise BulletSimError("%s but %s" % (counted(len(index), "joint"), counted(len(position), "position")))
        if not np.dot(position, position) <= _SURELY_FINE:
            for i, value in zip(index, position, strict=True):
                within(bounds.JOINT_POSITION, value, "the position of joint '%s'" % self.joint_names[i])
        if len(index):
            speeds = [0.0] * len(index) if velocity is None else velocity.tolist()
            self.parts.put(np.asarray(index), position.tolist(), speeds)
            self._reading = None
        self._world.wake_all()

    def gravity_efforts(self, position: np.ndarray | None = None) -> np.ndarray:
        """Return the efforts (n,) that balance gravity at ``position`` (n,), default the present one.

        Inverse dynamics without velocity and acceleration. Raises BulletSimError for a model that is not fixed.
        """
        return self.inverse_dynamics(position if position is not None else self.read_joints()[0])

    def inverse_dynamics(self, position: np.ndarray, velocity: np.ndarray | None = None,
                         acceleration: np.ndarray | None = None) -> np.ndarray:
        """Return the efforts (n,) that give ``acceleration`` (n,) at ``position`` (n,) and ``velocity`` (n,)."""
        if self.free:
            raise BulletSimError("inverse dynamics need a fixed base; model '%s' is free" % self.name)
        if not self._all:
            return np.empty(0)
        tilted = self._gravity_in_base()
        if tilted is not None:
            # Bullet's inverse dynamics take the root's axes for the world's.
            pybullet.setGravity(*tilted, physicsClientId=self._client)
        efforts = self.parts.inverse_dynamics(
            position.tolist(),
            self._zeros if velocity is None else velocity.tolist(),
            self._zeros if acceleration is None else acceleration.tolist(),
        )
        if tilted is not None:
            pybullet.setGravity(*self._world.gravity, physicsClientId=self._client)
        return np.array(efforts)

    def mass_matrix(self, position: np.ndarray) -> np.ndarray:
        """Return the joint-space inertia (n, n) at ``position`` (n,); only for a model that is fixed."""
        if self.free:
            raise BulletSimError("the joint-space inertia needs a fixed base; model '%s' is free" % self.name)
        inertia = np.zeros((len(self._all), len(self._all)))
        for numbers, block in self.parts.mass_matrices(position.tolist()):
            inertia[np.ix_(numbers, numbers)] = block
        return inertia

    def remove(self) -> None:
        """For World: take the body out of the physics."""
        for gear in (*self._gears.values(), *self._loops):
            pybullet.removeConstraint(gear, physicsClientId=self._client)
        self.parts.remove()

    def set_base_pose(self, pose: Pose) -> None:
        super().set_base_pose(pose)
        if self.static:
            # From the cache: a body that touched a NaN has no valid pose any more.
            base = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)
            self._good = (base, self._good[1])

    # -- start --------------------------------------------------------------------------------------------------

    def mark_start(self) -> None:
        """Remember base pose and joint positions as what ``reset`` returns to."""
        self._start = (self.base_pose(), self.read_joints()[0], self.loose_poses())
        base = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)
        self._good = (base, self._start[1])  # the last good pose, in PyBullet's frame of the base
        self._good_loose = self._loose_centres()

    def _loose_centres(self) -> dict[int, tuple]:
        """{index of a loose root: PyBullet's (position, quaternion)}"""
        return {index: pybullet.getBasePositionAndOrientation(self.parts.places[index].body,
                                                              physicsClientId=self._client) for index in self.loose}

    def reset(self) -> None:
        """Return to the marked start, at rest. Drives stay as they are."""
        pose, position, loose = self._start
        self.set_base_pose(pose)
        for body, place in zip(self.merged.loose, loose, strict=True):
            self.set_root_pose(body, place)
        if self.free:
            self.set_base_twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.set_joint_positions(np.arange(len(position)), position)

    # -- for World: when the physics has failed -----------------------------------------------------------------

    def fault(self) -> ImpossibleState | None:
        """Return the ImpossibleState of the present state, or None if it is good; then it is kept as the last good one.

        Called after every step, so one sum checks all numbers.
        """
        if self.static:
            base, total = self._good[0], 0.0
        else:
            base = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)
            (x, y, z), (a, b, c, d) = base
            total = x * x + y * y + z * z + a * a + b * b + c * c + d * d
        loose = self._loose_centres() if self.loose else {}
        for place, turn in loose.values():
            total += sum(value * value for value in (*place, *turn))
        joints = self._good[1]
        if self._all:
            joints, velocity, _ = self.read_joints()
            position_size, quick, effort_size = self._sizes
            total += position_size * position_size + quick * quick + _LIGHT * effort_size * effort_size
        if not total <= _SURELY_FINE:
            found = out_of_bounds({self._link_names[-1]: base, **{self._link_names[i]: b for i, b in loose.items()}},
                                  self.joint_names, self.read_joints())
            if found:
                return ImpossibleState(found, math.isfinite(total))
        if self._all and quick > _QUICK:
            joints = self._stop_at_limits(joints, velocity)
        self.still_for = self.still_for + 1 if base == self._good[0] else 0
        self._good, self._good_loose = (base, joints), loose
        return None

    def _stop_at_limits(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Put fast joints that passed their limits back to them; return the positions (n,).

        In the next step Bullet stops them there, and the links on them feel the impact.
        """
        through, = np.nonzero(((position < self.lower) | (position > self.upper)) & (np.abs(velocity) > _QUICK))
        if not len(through):
            return position
        stops = np.clip(position[through], self.lower[through], self.upper[through])
        self.parts.put(through, stops.tolist(), velocity[through].tolist())
        self._reading = None
        return self.read_joints()[0]

    def motion(self) -> MultibodyState:
        """Return the state that :meth:`take_parts` needs to continue the present motion."""
        twist = None if self.static else pybullet.getBaseVelocity(self.body, physicsClientId=self._client)
        base = self._good[0]
        if not self.static:
            base = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)
        position, velocity, _ = self.read_joints()
        loose = {index: (centre, pybullet.getBaseVelocity(self.parts.places[index].body, physicsClientId=self._client))
                 for index, centre in self._loose_centres().items()}
        return MultibodyState(base, position, twist, velocity, loose)

    def last_good(self) -> MultibodyState:
        """Return the state that :meth:`take_parts` needs to put the model at its last good state, at rest."""
        loose = {index: (centre, None) for index, centre in self._good_loose.items()}
        base, joints = self._good
        return MultibodyState(base, joints, None, np.zeros(len(self._all)), loose)

    def put_back(self) -> None:
        """Restore the last good state, at rest."""
        (position, quaternion), joints = self._good
        if not self.static:
            pybullet.resetBasePositionAndOrientation(self.body, position, quaternion, physicsClientId=self._client)
        for index, centre in self._good_loose.items():
            self.parts.set_root(index, *centre)
        if self.free:
            self.set_base_twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.set_joint_positions(np.arange(len(self._all)), joints)

    def take_parts(self, parts: Multibodies, motion: MultibodyState) -> None:
        """Continue with ``parts``, the rebuilt copy of the previous ones."""
        base, joints, twist, velocity, loose = motion
        client = {"physicsClientId": self._client}
        self.parts, self._reading, self._gears = parts, None, {}
        self._effort_driven[:] = self._any_effort_driven = False
        if twist is not None:
            pybullet.resetBaseVelocity(self.body, *twist, **client)
        for index, (centre, moving) in loose.items():
            parts.set_root(index, *centre)
            if moving is not None:
                pybullet.resetBaseVelocity(parts.places[index].body, *moving, **client)
        self._damping.restore()
        for index in range(len(self._all)):
            if math.isfinite(self.lower[index]) or math.isfinite(self.upper[index]):
                pybullet.changeDynamics(*parts.places[index], jointLowerLimit=self.lower[index],
                                        jointUpperLimit=self.upper[index], **client)
        if self._all:
            self.release(np.arange(len(self._all)))
            parts.put(np.arange(len(self._all)), joints.tolist(), velocity.tolist())
        for pair, ratio in self._couplings.items():
            self.couple(*pair, ratio)
        self._loops = close_loops(self._client, self.merged, parts)
        self._restore_collisions()
        self._good, self._good_loose = (base, joints), {index: centre for index, (centre, _) in loose.items()}

    # -- inside -------------------------------------------------------------------------------------------------

    def _rebuild(self, motion: MultibodyState | None = None) -> None:
        self._world.rebuild([self], None if motion is None else {self: motion})

    def _refuse_nan(self, index: np.ndarray, values: list[float], what: str) -> None:
        """Raise BulletSimError where one of ``values``, a list for joints ``index`` (k,), is not a number."""
        if math.isnan(sum(values)):  # also of two infinities
            bad = [self.joint_names[i] for i, value in zip(index, values, strict=True) if math.isnan(value)]
            if bad:
                raise BulletSimError("the %s for %s of '%s' is nan; expected a number"
                                     % (what, ", ".join(bad), self.name))

    def _gravity_in_base(self) -> list[float] | None:
        """Return gravity (3,) in the axes of a fixed root, or None where gravity is the same in both."""
        key = (self._base_quaternion, self._world.gravity)
        if key != self._gravity_key:
            rotation = Pose((0.0, 0.0, 0.0), self._base_quaternion).matrix()[:3, :3]
            turned = rotation.T @ self._world.gravity
            self._turned_gravity = None if np.allclose(turned, self._world.gravity, atol=1e-9) else turned.tolist()
            self._gravity_key = key
        return self._turned_gravity

    def _forget(self, index: np.ndarray) -> None:
        """Note that joints ``index`` (k,) are told something else than by the last ``drive_position``."""
        if self._told:
            joints = index.tolist()
            self._told = {key: kept for key, kept in self._told.items() if kept[0].isdisjoint(joints)}

    def _drive_otherwise(self, index: np.ndarray) -> None:
        """Note that joints ``index`` (k,) are no longer driven by efforts."""
        if self._any_effort_driven:
            self._effort_driven[index] = False
            self._any_effort_driven = bool(self._effort_driven.any())
            self._reading = None


def _column(joints: Sequence[Joint], field: str, absent: float) -> np.ndarray:
    values = (getattr(joint.limit, field) for joint in joints)
    return np.array([absent if value is None else value for value in values], dtype=float)
