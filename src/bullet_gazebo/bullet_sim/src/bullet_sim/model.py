# SPDX-License-Identifier: BSD-3-Clause
"""One robot or object in the world: its joints as arrays, its links by name."""

import math
from typing import NamedTuple

import numpy as np
import pybullet

from urdf_model import Inertial
from urdf_model.transforms import inverse

from .errors import BulletSimError
from .pose import Pose

# Bullet's joint motor reaches its target as velocity = gain * error / time step. With 20 solver iterations a gain of
# 0.5 holds Baxter's arms within 5e-5 rad for 0.11 ms a step; the default of 0.1 sags by 2.4e-4 rad.
POSITION_GAIN = 0.5

# Bullet applies joint damping explicitly: beyond inertia / time step it pumps energy in. Half of that stays clear.
_DAMPING_MARGIN = 0.5

# What keeps coupled joints together at most [N, Nm]: more than any drive of a finger.
_GEAR_FORCE = 1000.0

BASE = -1  # PyBullet's index of the root link


class Contact(NamedTuple):
    """A point where two bodies touch. Links by their merged names, world coordinates, SI units."""

    model_a: str
    link_a: str
    model_b: str
    link_b: str
    position: tuple
    normal: tuple  # unit, on b, towards a
    distance: float  # negative when the shapes overlap
    force: float  # along the normal, in the last step


class Model:
    """Made by ``World.spawn``. All arrays over joints are in the order of ``joint_names``; SI units and radians.

    A drive holds until another one replaces it, except efforts, which last one step.
    """

    def __init__(self, client, name, robot, merged, body, root_offset, static, world):
        self.name = name
        self.robot = robot
        self.merged = merged
        self.static = static
        self.body = body
        self._client = client
        self._world = world
        self._root_offset = root_offset
        self._root_offset_inverse = inverse(root_offset)
        self._root_is_centre = bool(np.array_equal(root_offset, np.eye(4)))
        # Of a fixed root; known here so that a tick need not ask for it.
        self._base_quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)[1]
        self._gravity_key = None
        self._turned_gravity = None
        joints = list(merged.joints.values())
        self.joint_names = tuple(joint.name for joint in joints)
        self._index = {joint.name: i for i, joint in enumerate(joints)}
        self._link_index = {merged.root: BASE, **{joint.child: i for i, joint in enumerate(joints)}}
        self._link_names = {index: link for link, index in self._link_index.items()}
        self.lower = _column(joints, "lower", -math.inf)
        self.upper = _column(joints, "upper", math.inf)
        self.max_velocity = _column(joints, "velocity", math.inf)
        self.max_effort = _column(joints, "effort", math.inf)
        count = len(joints)
        self._all = list(range(count))
        self._effort_driven, self._any_effort_driven = np.zeros(count, dtype=bool), False
        self._commanded_effort = np.zeros(count)
        self._zeros = [0.0] * count
        self._pairs = ()
        self.set_self_collision_pairs(())
        self._weightless = {}  # body's name -> its mass
        for link in merged.links.values():
            if not link.gravity:
                self.set_weight(link.name, False)
        self._bounds = None
        self._late_twist = None
        self._late_pushes = []
        self._gears = []
        self._set_damping(joints)
        if count:
            self.release(np.arange(count))
        self.mark_start()

    # -- joints -------------------------------------------------------------------------------------------------

    def index(self, names):
        """Return the indices (int array) of joints given by name. Raises BulletSimError that lists the known ones."""
        try:
            return np.array([self._index[name] for name in names], dtype=int)
        except KeyError as error:
            raise BulletSimError(
                "model '%s' has no joint %s; its joints are %s" % (self.name, error, ", ".join(self.joint_names))
            ) from None

    def read_joints(self):
        """Return positions, velocities and efforts, three (n,) arrays, as they are after the last step.

        The effort is what the drive applied during the last step.
        """
        if not self._all:
            return np.empty(0), np.empty(0), np.empty(0)
        states = pybullet.getJointStates(self.body, self._all, physicsClientId=self._client)
        position, velocity, _, effort = zip(*states, strict=True)
        effort = np.array(effort)
        if self._any_effort_driven:
            # Bullet's reading does not know of explicit torques.
            effort[self._effort_driven] = self._commanded_effort[self._effort_driven]
        return np.array(position), np.array(velocity), effort

    def drive_position(self, index, position, max_effort, velocity=None):
        """Pull joints ``index`` (k,) to ``position`` (k,) with at most ``max_effort`` (k,).

        Bullet solves the motor with the other constraints (implicitly), so that stiff is stable.

        ``position`` is where the joint shall be after the step. ``velocity`` (k,) is the set-point's own velocity:
        given, a moving set-point is followed without lag.
        """
        self._drive_otherwise(index)
        gains = len(index)
        if velocity is not None:
            # The motor adds the velocity to what closes the gap, so the gap is the one at the beginning of the step.
            position = position - velocity * self._world.time_step_s
        pybullet.setJointMotorControlArray(
            self.body,
            index.tolist(),
            pybullet.POSITION_CONTROL,
            targetPositions=position.tolist(),
            targetVelocities=[0.0] * gains if velocity is None else velocity.tolist(),
            forces=max_effort.tolist(),
            positionGains=[POSITION_GAIN] * gains,
            velocityGains=[1.0] * gains,
            physicsClientId=self._client,
        )

    def drive_velocity(self, index, velocity, max_effort):
        """Keep joints ``index`` (k,) at ``velocity`` (k,) with at most ``max_effort`` (k,)."""
        self._drive_otherwise(index)
        pybullet.setJointMotorControlArray(
            self.body,
            index.tolist(),
            pybullet.VELOCITY_CONTROL,
            targetVelocities=velocity.tolist(),
            forces=max_effort.tolist(),
            physicsClientId=self._client,
        )

    def drive_effort(self, index, effort):
        """Apply ``effort`` (k,) to joints ``index`` (k,) during the next step; say it again for every step."""
        if not self._effort_driven[index].all():
            self.release(index)
            self._effort_driven[index] = self._any_effort_driven = True
        self._commanded_effort[index] = effort
        pybullet.setJointMotorControlArray(
            self.body, index.tolist(), pybullet.TORQUE_CONTROL, forces=effort.tolist(), physicsClientId=self._client
        )

    def add_effort(self, index, effort):
        """Apply ``effort`` (k,) to joints ``index`` (k,) during the next step, on top of what drives them."""
        self.wake()
        pybullet.setJointMotorControlArray(
            self.body, index.tolist(), pybullet.TORQUE_CONTROL, forces=effort.tolist(), physicsClientId=self._client
        )

    def set_damping(self, index, damping):
        """Set the viscous damping of joint ``index`` [Nm s/rad or N s/m], as far as the tick's length allows it."""
        self.damping[index] = min(damping, self._damping_bounds()[index])
        pybullet.changeDynamics(self.body, index, jointDamping=self.damping[index], physicsClientId=self._client)

    def set_limits(self, index, lower, upper):
        """Set how far joint ``index`` goes [rad or m]. Raises BulletSimError where ``lower`` is not below ``upper``."""
        if not lower < upper:
            raise BulletSimError("a lower limit of %g is not below the upper limit %g" % (lower, upper))
        pybullet.changeDynamics(
            self.body, index, jointLowerLimit=lower, jointUpperLimit=upper, physicsClientId=self._client
        )
        self.lower[index], self.upper[index] = lower, upper

    def couple(self, joint, other, ratio):
        """Have the joint with index ``other`` move ``ratio`` times as far as ``joint``, as a gear does, for good.

        Both carry each other's load: what drives one drives both.
        """
        gear = pybullet.createConstraint(
            self.body, int(joint), self.body, int(other), pybullet.JOINT_GEAR, (0, 0, 1), (0, 0, 0), (0, 0, 0),
            physicsClientId=self._client,
        )
        pybullet.changeConstraint(
            gear, gearRatio=-1.0 / ratio, erp=POSITION_GAIN, maxForce=_GEAR_FORCE, physicsClientId=self._client
        )
        self._gears.append(gear)

    def release(self, index):
        """Switch the motors of joints ``index`` (k,) off."""
        self._drive_otherwise(index)
        self.drive_velocity(index, np.zeros(len(index)), np.zeros(len(index)))

    def set_joint_positions(self, index, position):
        """Put joints ``index`` (k,) at ``position`` (k,), at rest, at once. Nothing in between is simulated."""
        if len(index) != len(position):
            raise BulletSimError("%d joints but %d positions" % (len(index), len(position)))
        if len(index):
            # In one call, since each works out anew where every link is.
            pybullet.resetJointStatesMultiDof(
                self.body,
                index.tolist(),
                position[:, None].tolist(),
                np.zeros((len(index), 1)).tolist(),
                physicsClientId=self._client,
            )
        self._world.wake_all()

    def gravity_efforts(self, position=None):
        """Return the efforts (n,) that balance gravity at ``position`` (n,), default the present one.

        Inverse dynamics without velocity and acceleration. Raises BulletSimError for a model that is not fixed.
        """
        return self.inverse_dynamics(position if position is not None else self.read_joints()[0])

    def inverse_dynamics(self, position, velocity=None, acceleration=None):
        """Return the efforts (n,) that give ``acceleration`` (n,) at ``position`` (n,) and ``velocity`` (n,)."""
        if not self.static:
            raise BulletSimError("inverse dynamics need a fixed base; model '%s' is free" % self.name)
        if not self._all:
            return np.empty(0)
        tilted = self._gravity_in_base()
        if tilted is not None:
            # Bullet's inverse dynamics take the root's axes for the world's.
            pybullet.setGravity(*tilted, physicsClientId=self._client)
        efforts = pybullet.calculateInverseDynamics(
            self.body,
            position.tolist(),
            self._zeros if velocity is None else velocity.tolist(),
            self._zeros if acceleration is None else acceleration.tolist(),
            physicsClientId=self._client,
        )
        if tilted is not None:
            pybullet.setGravity(*self._world.gravity, physicsClientId=self._client)
        return np.array(efforts)

    def mass_matrix(self, position):
        """Return the joint-space inertia (n, n) at ``position`` (n,); only for a model that is fixed."""
        if not self.static:
            raise BulletSimError("the joint-space inertia needs a fixed base; model '%s' is free" % self.name)
        return np.array(pybullet.calculateMassMatrix(self.body, position.tolist(), physicsClientId=self._client))

    # -- links --------------------------------------------------------------------------------------------------

    @property
    def link_names(self):
        """The links of the description, those that were merged included."""
        return tuple(self.merged.frames)

    def link_pose(self, link):
        """Return the pose of a link's frame in the world. Raises BulletSimError for an unknown link."""
        return Pose.from_matrix(self._link_matrix(link))

    def link_twist(self, link):
        """Return (linear (3,), angular (3,)) velocity of a link's frame, in world axes [m/s, rad/s]."""
        frame = self._frame(link)
        index = self._link_index[frame.link]
        return self._twist(index, (self._body_matrix(index) @ frame.offset)[:3, 3])

    def base_pose(self):
        """Return the pose of the model's frame in the world; for a URDF that is the root link's."""
        if self._root_is_centre:
            return Pose(*pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client))
        return Pose.from_matrix(self._body_matrix(BASE))

    def set_base_pose(self, pose):
        """Put the model's frame at ``pose``, at rest if it is free; joints keep their positions."""
        centre = Pose.from_matrix(pose.checked().matrix() @ self._root_offset)
        pybullet.resetBasePositionAndOrientation(
            self.body, centre.position, centre.quaternion, physicsClientId=self._client
        )
        self._base_quaternion = centre.quaternion
        self._late_twist = None
        self._world.wake_all()

    def base_twist(self):
        """Return (linear (3,), angular (3,)) velocity of the model's frame, in world axes."""
        return self._twist(BASE, self._body_matrix(BASE)[:3, 3])

    def set_base_twist(self, linear, angular):
        """Set the velocity of a free model's frame, in world axes [m/s, rad/s]."""
        angular = np.asarray(angular, dtype=float)
        # The frame moves at `linear`; Bullet wants the velocity of the centre of mass.
        arm = self._body_matrix(BASE)[:3, :3] @ self._root_offset[:3, 3]
        at_centre = np.asarray(linear, dtype=float) + np.cross(angular, arm)
        self._late_twist = (at_centre.tolist(), angular.tolist())
        pybullet.resetBaseVelocity(self.body, *self._late_twist, physicsClientId=self._client)
        self.wake()

    def apply_wrench(self, link, force, torque=(0.0, 0.0, 0.0), position=None):
        """Push a link during the next step: ``force`` [N] and ``torque`` [Nm] in world axes.

        The force acts at ``position`` (world, m), by default at the centre of mass of the link's body.
        """
        push = (self._link_index[self._frame(link).link], force, torque, position)
        if not self.static:
            self._late_pushes.append(push)
        self.wake()
        self._push(*push)

    def wake(self):
        """Have the model simulated again if it has come to rest and fallen asleep."""
        if not self.static:
            pybullet.changeDynamics(
                self.body, BASE, activationState=pybullet.ACTIVATION_STATE_WAKE_UP, physicsClientId=self._client
            )
            self._world.note_touched(self)

    def feel_again(self):
        """For World, after a step: repeat what was done to the model while it slept.

        Bullet wakes a body at the end of a step, so the first one after the touch passes without it: its velocity is
        exactly zero then, whatever was done.
        """
        twist, self._late_twist = self._late_twist, None
        pushes, self._late_pushes = self._late_pushes, []
        if not (twist or pushes):
            return
        velocity = pybullet.getBaseVelocity(self.body, physicsClientId=self._client)
        if any(velocity[0]) or any(velocity[1]):
            return
        if twist:
            pybullet.resetBaseVelocity(self.body, *twist, physicsClientId=self._client)
        for push in pushes:
            self._push(*push)

    def contact_force(self, link):
        """Return the force (3,) [N, world axes] with which others pressed on a link's body in the last step.

        Without friction.
        """
        total = np.zeros(3)
        index = self._link_index[self._frame(link).link]
        points = pybullet.getContactPoints(bodyA=self.body, linkIndexA=index, physicsClientId=self._client)
        for point in points or ():
            total += point[9] * np.array(point[7])
        return total

    def grip_firmly(self, link):
        """Have friction at a link's body hold without creeping: Bullet's otherwise gives way by 0.3 mm/s under load."""
        index = self._link_index[self._frame(link).link]
        pybullet.changeDynamics(self.body, index, frictionAnchor=1, physicsClientId=self._client)

    def renew_contacts(self, link):
        """Forget the contacts of a link's body; the next step finds those that there are.

        Bullet keeps contacts from step to step, and once in a while one that is none: with a normal that two nearly
        parallel edges made up, it can hold a body that should come free.
        """
        index = self._link_index[self._frame(link).link]
        # Every body is in group 1 and collides with all; saying so again has Bullet begin anew with it.
        pybullet.setCollisionFilterGroupMask(self.body, index, 1, -1, physicsClientId=self._client)

    def remove(self):
        """For World: take the body out of the physics."""
        for gear in self._gears:
            pybullet.removeConstraint(gear, physicsClientId=self._client)
        pybullet.removeBody(self.body, physicsClientId=self._client)

    # -- mass properties, of bodies: links with what is fixed to them ---------------------------------------------

    def inertial(self, body):
        """Return the urdf_model.Inertial of the body ``body``, in its link's frame. Raises BulletSimError."""
        link = self._body(body)
        offset = self.merged.frames[body].offset
        rotation = offset[:3, :3]
        return Inertial(
            link.inertial.mass,
            rotation.T @ (link.inertial.centre - offset[:3, 3]),
            rotation.T @ link.inertial.inertia @ rotation,
        )

    def set_inertial(self, body, mass, inertia):
        """Set mass [kg] and inertia (3, 3) about the centre of mass [kg m^2, axes of the link's frame] of a body.

        Raises BulletSimError for a root that is fixed, for what no body can have, and for an inertia whose principal
        axes are others than before: PyBullet sets those when it makes the body.
        """
        link = self._body(body)
        index = self._link_index[body]
        if self.static and index == BASE:
            raise BulletSimError("link '%s' of '%s' is fixed in the world; its mass has no effect" % (body, self.name))
        inertia = np.asarray(inertia, dtype=float)
        if not (math.isfinite(mass) and mass > 0.0 and np.isfinite(inertia).all()):
            raise BulletSimError("a mass of %g kg cannot be set; expected a positive number" % mass)
        rotation = self.merged.frames[body].offset[:3, :3]
        inertia = rotation @ inertia @ rotation.T
        arguments = {"physicsClientId": self._client}
        info = pybullet.getDynamicsInfo(self.body, index, **arguments)
        axes = Pose((0.0, 0.0, 0.0), info[4]).matrix()[:3, :3]
        turned = axes.T @ inertia @ axes
        moments = np.diag(turned)
        if moments.min() <= 0.0:
            raise BulletSimError("the inertia %s has a moment that is not positive" % inertia.tolist())
        if np.abs(turned - np.diag(moments)).max() > 1e-3 * moments.max():
            raise BulletSimError(
                "the principal axes of link '%s' cannot be turned; give an inertia with the present axes" % body
            )
        pybullet.changeDynamics(self.body, index, mass=mass, **arguments)
        # After the mass, which makes PyBullet guess an inertia of its own.
        pybullet.changeDynamics(self.body, index, localInertiaDiagonal=moments.tolist(), **arguments)
        link.inertial = Inertial(mass, link.inertial.centre, inertia)
        if body in self._weightless:
            self._weightless[body] = mass
        self.wake()

    def has_weight(self, body):
        """Whether gravity acts on the body ``body``."""
        self._body(body)
        return body not in self._weightless

    def set_weight(self, body, wanted):
        """Have gravity act on the body ``body``, or not."""
        mass = self._body(body).inertial.mass
        self._weightless.pop(body, None)
        if not wanted and not (self.static and body == self.merged.root):
            self._weightless[body] = mass
        self._world.note_weightless(self, bool(self._weightless))
        self.wake()

    def cancel_weight(self):
        """For World: take the weight off those bodies that have none, for the next step."""
        gravity = np.array(self._world.gravity)
        for body, mass in self._weightless.items():
            self._push(self._link_index[body], -mass * gravity)

    # -- collisions ---------------------------------------------------------------------------------------------

    def set_self_collision_pairs(self, pairs):
        """Let exactly these ``pairs`` of links collide with each other; at the start none do, as in Gazebo.

        Two links with one joint between them never collide, whatever is asked."""
        wanted = set()
        for pair in pairs:
            a, b = (self._link_index[self._frame(link).link] for link in pair)
            if a != b:
                wanted.add((min(a, b), max(a, b)))
        links = sorted(self._link_names)
        for i, a in enumerate(links):
            for b in links[i + 1 :]:
                pybullet.setCollisionFilterPair(
                    self.body, self.body, a, b, int((a, b) in wanted), physicsClientId=self._client
                )
        self._pairs = tuple(sorted(wanted))

    def link_name(self, index):
        """Return the merged name of the link that PyBullet numbers ``index`` (-1 is the root)."""
        return self._link_names[index]

    # -- start --------------------------------------------------------------------------------------------------

    def mark_start(self):
        """Remember base pose and joint positions as what ``reset`` returns to."""
        self._start = (self.base_pose(), self.read_joints()[0])

    def reset(self):
        """Return to the marked start, at rest. Drives stay as they are."""
        pose, position = self._start
        self.set_base_pose(pose)
        if not self.static:
            self.set_base_twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.set_joint_positions(np.arange(len(position)), position)

    # -- inside -------------------------------------------------------------------------------------------------

    def _frame(self, link):
        try:
            return self.merged.frames[link]
        except KeyError:
            raise BulletSimError(
                "model '%s' has no link '%s'; its links are %s" % (self.name, link, ", ".join(self.link_names))
            ) from None

    def _body(self, body):
        """Return the MergedLink ``body``; raises BulletSimError, with where it went for a link that was merged."""
        if body not in self.merged.links:
            frame = self._frame(body)
            raise BulletSimError(
                "link '%s' of '%s' is fixed to link '%s' and has its mass there; ask for that one"
                % (body, self.name, frame.link)
            )
        return self.merged.links[body]

    def _link_matrix(self, link):
        frame = self._frame(link)
        return self._body_matrix(self._link_index[frame.link]) @ frame.offset

    def _body_matrix(self, index):
        if index == BASE:
            centre = Pose(*pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client))
            return centre.matrix() @ self._root_offset_inverse
        state = pybullet.getLinkState(self.body, index, computeForwardKinematics=1, physicsClientId=self._client)
        return Pose(state[4], state[5]).matrix()

    def _twist(self, index, point):
        """Return (linear, angular) velocity of ``point`` (3,) (world) of a body, in world axes."""
        if index == BASE:
            linear, angular = map(np.array, pybullet.getBaseVelocity(self.body, physicsClientId=self._client))
            centre = np.array(pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)[0])
        else:
            state = pybullet.getLinkState(self.body, index, computeLinkVelocity=1, physicsClientId=self._client)
            centre, linear, angular = np.array(state[0]), np.array(state[6]), np.array(state[7])
        return linear + np.cross(angular, point - centre), angular

    def _push(self, index, force, torque=(0.0, 0.0, 0.0), position=None):
        if position is None:
            if index == BASE:
                position = pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self._client)[0]
            else:
                position = pybullet.getLinkState(self.body, index, physicsClientId=self._client)[0]
        arguments = {"flags": pybullet.WORLD_FRAME, "physicsClientId": self._client}
        pybullet.applyExternalForce(self.body, index, list(force), list(position), **arguments)
        if any(torque):
            pybullet.applyExternalTorque(self.body, index, list(torque), **arguments)

    def _gravity_in_base(self):
        """Return gravity (3,) in the axes of a fixed root, or None where gravity is the same in both."""
        key = (self._base_quaternion, self._world.gravity)
        if key != self._gravity_key:
            rotation = Pose((0.0, 0.0, 0.0), self._base_quaternion).matrix()[:3, :3]
            turned = rotation.T @ self._world.gravity
            self._turned_gravity = None if np.allclose(turned, self._world.gravity, atol=1e-9) else turned.tolist()
            self._gravity_key = key
        return self._turned_gravity

    def _drive_otherwise(self, index):
        """Note that joints ``index`` (k,) are no longer driven by efforts."""
        if self._any_effort_driven:
            self._effort_driven[index] = False
            self._any_effort_driven = bool(self._effort_driven.any())

    def _set_damping(self, joints):
        self.damping = np.zeros(len(joints))  # (n,) as it acts, [Nm s/rad] or [N s/m]
        for index, joint in enumerate(joints):
            if joint.damping > 0.0:
                self.set_damping(index, joint.damping)

    def _damping_bounds(self):
        """Return the damping (n,) of each joint that is still sure to be stable, at the present position."""
        if self._bounds is None:
            felt = np.full(len(self.joint_names), math.inf)
            if self.static:
                # The inertia that a joint feels when the others are free to give way is 1 / (M^-1)_ii.
                felt = 1.0 / np.diag(np.linalg.inv(self.mass_matrix(self.read_joints()[0])))
            self._bounds = _DAMPING_MARGIN * felt / self._world.time_step_s
        return self._bounds


def _column(joints, field, absent):
    values = (getattr(joint.limit, field) for joint in joints)
    return np.array([absent if value is None else value for value in values], dtype=float)
