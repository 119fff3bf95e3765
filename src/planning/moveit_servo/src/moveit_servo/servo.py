# SPDX-License-Identifier: BSD-3-Clause
"""The servo of one arm: from the robot's state and a command to the set-points of the next step, and why they are not
those wanted. Time and state are arguments.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from arm_kinematics import Chain, ChainError
from moveit_servo.directions import ServoArm, Thresholds, jacobian_of, velocity_for
from moveit_servo.limits import ServoLimits, ServoMotion, stoppable
from moveit_servo.pose_tracking import PoseTracker
from moveit_servo.possible import LEAD_RAD, Possible, Rates, possible, shares
from moveit_servo.settings import STOP_DISTANCE, SettingsError
from moveit_servo.straight import StraightWay

if TYPE_CHECKING:
    from motion_planning.model import Group, PlanningModel
    from moveit_servo.settings import ServoSettings
    from moveit_servo.surroundings import Surroundings

# Within this distance of the joints [rad] set-points are kept between two motions, so that an arm that sags a little
# does not creep.
_SAME_RAD = 0.03
# An arm in motion that is so far from its set-points [rad] has been moved by others, and must not be thrown back: a
# blocked one stays much nearer, see ``LEAD_RAD``.
_MOVED_RAD = 0.3
# Speed at which a threshold of distance is the place where slowing down begins [m/s].
_SPEED_AT_THRESHOLD = 0.4
# Gaps are looked for up to this distance [m]; the fastest hand needs no more to stop.
_REACH_M = 0.12
# Spheres come no nearer than this [m]: an arm is some millimetres beside its set-points, sideways too.
_CLEARANCE_M = 0.005
# A pose counts as reached within these.
_REACHED_M, _REACHED_RAD = 1e-4, 1e-3
# Shares of a motion: what is lost less than the first is not worth a status; less than the second remains of a halt.
_NOTICED, _REMAINS = 0.02, 0.05
_AT_REST = 1e-6


class Status(IntEnum):
    """The codes of MoveIt Servo's status."""

    INVALID = -1
    NO_WARNING = 0
    DECELERATE_FOR_SINGULARITY = 1
    HALT_FOR_SINGULARITY = 2
    DECELERATE_FOR_COLLISION = 3
    HALT_FOR_COLLISION = 4
    JOINT_BOUND = 5


class ServoStep(NamedTuple):
    """Set-points (k,) of the arm's joints after a step, and what held them back.

    reason: a sentence, empty for NO_WARNING. rests: nothing moves and nothing is wanted. reached: the pose is there.
    moving: time since the arm last rested, until it does again [s].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    status: Status
    reason: str
    rests: bool
    reached: bool
    moving: float = math.inf


@dataclass(frozen=True)
class ServoCommand:
    """A command: one of twist (6,) [m/s, rad/s], joint velocities (k,) [per s], and a pose (4, 4) of the tip in
    the model's frame; none of them: to stop. axes (3, 3): those of the twist, as columns in the model's frame. drift
    (6,) bool: rows of the twist that do not matter."""

    twist: np.ndarray | None = None
    joints: np.ndarray | None = None
    pose: np.ndarray | None = None
    drift: np.ndarray = field(default_factory=lambda: np.zeros(6, dtype=bool))
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))

    def __bool__(self) -> bool:
        return self.pose is not None or any(part is not None and part.any() for part in (self.twist, self.joints))


class _Wanted(NamedTuple):
    """A motion that is possible: velocity (k,); together: as for ServoMotion.follow; slope (m, k) @ velocity >= least
    (m,) keeps what is near from coming too near."""

    velocity: np.ndarray
    status: Status = Status.NO_WARNING
    reason: str = ""
    together: bool = True
    slope: np.ndarray = np.empty((0, 1))
    least: np.ndarray = np.empty(0)


class Servo:
    """The arm of one group of a model. ``settings`` and ``surroundings`` (None: nothing is checked) may be replaced
    between steps. joints: names of the k joints, in the order of all arrays; tip: link that is steered."""

    def __init__(self, model: PlanningModel, settings: ServoSettings) -> None:
        """Raises SettingsError for a group or link that cannot be steered."""
        self.model = model
        self.group, base, self.tip = _steered(model, settings.move_group_name)
        self._chain = _chain_of(model, self.group, base, self.tip)
        self.joints = self._chain.joint_names
        self._indices = np.array([model.index[name] for name in self.joints])
        self._rows = np.searchsorted(self.group.indices, self._indices)
        #: Pose (4, 4) of the model's root in its frame.
        self.base = np.eye(4)
        self._base_moves = any(joint.movable for joint in model.robot.chain(model.root, base))
        self._base_in_root = model.frame_of(model.default_state().q, base)
        self._nothing_near = (np.empty(0), np.empty((0, len(self.joints))), np.empty(0), np.empty(0, dtype=bool))
        self.surroundings: Surroundings | None = None
        self._motion: ServoMotion | None = None
        self._tracker, self._target, self._way = PoseTracker(), None, StraightWay()
        self._rests, self._moving = True, 0.0
        self.settings = settings

    @property
    def settings(self) -> ServoSettings:
        return self._settings

    @settings.setter
    def settings(self, settings: ServoSettings) -> None:
        self.limits = self._limits(settings)
        self._settings, self._rates = settings, _rates(settings)
        if self._motion is not None:
            before, self._motion = self._motion, ServoMotion(self._motion.position, self.limits)
            self._motion.velocity, self._motion.acceleration = before.velocity, before.acceleration

    def _limits(self, settings: ServoSettings) -> ServoLimits:
        said = settings.max_acceleration
        if isinstance(said, dict):
            missing = [name for name in self.joints if name not in said]
            if missing:
                raise SettingsError("max_acceleration has no number for %s" % ", ".join(missing))
            said = np.array([float(said[name]) for name in self.joints])
        elif said is not None:
            said = np.full(len(self.joints), float(said))
        bounds, turns = self.model.bounds[self._indices], self.model.continuous[self._indices]
        half = np.where(turns, np.inf, 0.5 * (bounds[:, 1] - bounds[:, 0]))
        narrow = int(half.argmin())
        if settings.joint_limit_margin >= half[narrow]:
            raise SettingsError("joint_limit_margin is %g; expected less than %g, half the range of joint %s"
                                % (settings.joint_limit_margin, half[narrow], self.joints[narrow]))
        return stoppable(np.where(turns, -np.inf, bounds[:, 0]), np.where(turns, np.inf, bounds[:, 1]),
                         self.model.velocity[self._indices], said, settings.stopping_time)

    def reset(self) -> None:
        """Forget the motion: the next step begins at the measured posture, at rest."""
        self._motion, self._target, self._rests = None, None, True
        self._way.reset()

    def pose(self, q: np.ndarray, link: str = "") -> np.ndarray:
        """Return the pose (4, 4) of ``link``, empty: the tip, in the model's frame at ``q`` (n,)."""
        return self.model.frame_of(q, link or self.tip, self.base)

    def step(self, q: np.ndarray, velocity: np.ndarray, command: ServoCommand, seconds: float) -> ServoStep:
        """Return the ServoStep that comes ``seconds`` after the last one.

        q, velocity (n,): all joints of the model as measured. The command is that of now; the caller decides when one
        is too old.
        """
        measured = np.asarray(q, dtype=float)[self._indices]
        motion = self._motion
        if motion is None:
            motion = self._motion = ServoMotion(measured, self.limits)
        away, at_rest = np.abs(motion.position - measured), _at_rest(motion)
        moved = ""
        if away.max() > (_SAME_RAD if at_rest else _MOVED_RAD):
            motion.rest_at(measured)
            self._way.reset()
            self._target = None
            if not at_rest:
                moved = ("joint %s was moved by others, %.2f rad from its set-point; the arm goes on from where it is"
                         % (self.joints[int(away.argmax())], away.max()))
        whole = np.array(q, dtype=float)
        whole[self._indices] = motion.position
        reached = False
        if command.pose is not None:
            command, reached = self._towards(whole, command, command.pose, seconds)
            self._way.reset()
        else:
            self._target = None
            command = self._along(whole, command, seconds)
        if not command and _at_rest(motion):
            motion.rest_at(motion.position)
            self._rests = True
            return ServoStep(motion.position.copy(), motion.velocity.copy(), motion.acceleration.copy(),
                             Status.JOINT_BOUND if moved else Status.NO_WARNING, moved, True, reached, self._moving)
        if self._rests:
            self._rests, self._moving = False, 0.0
        self._moving += seconds
        wanted = _Wanted(np.zeros(len(measured)))
        if command:
            wanted = self._wanted(whole, velocity, motion.position, measured, command)
        status, reason = (Status.JOINT_BOUND, moved) if moved else (wanted.status, wanted.reason)
        if status is not Status.NO_WARNING:
            self._way.reset()
        try:
            motion.follow(wanted.velocity, seconds, wanted.together, wanted.slope, wanted.least)
        except ArithmeticError as error:
            motion.rest_at(motion.position)
            status, reason = Status.INVALID, str(error)
        return ServoStep(motion.position.copy(), motion.velocity.copy(), motion.acceleration.copy(), status, reason,
                         False, reached, self._moving)

    def _towards(self, whole: np.ndarray, command: ServoCommand, target: np.ndarray,
                 seconds: float) -> tuple[ServoCommand, bool]:
        """The twist towards the command's pose, ``target`` (4, 4), and whether that is reached."""
        if self._target is None:
            self._tracker.reset()
        self._target = target
        pose = self.pose(whole)
        twist = self._tracker.twist(pose, target, self.settings, seconds)
        angle = np.arccos(np.clip(0.5 * (np.trace(target[:3, :3].T @ pose[:3, :3]) - 1.0), -1.0, 1.0))
        if np.linalg.norm(target[:3, 3] - pose[:3, 3]) < _REACHED_M and angle < _REACHED_RAD:
            return ServoCommand(), True
        axes = command.axes
        twist = np.concatenate([axes.T @ twist[:3], axes.T @ twist[3:]])
        return ServoCommand(twist=twist, drift=command.drift, axes=axes), False

    def _along(self, whole: np.ndarray, command: ServoCommand, seconds: float) -> ServoCommand:
        """The command with a twist that keeps the hand on its way."""
        if command.twist is None or not command.twist.any():
            self._way.reset()
            return command
        axes = command.axes
        twist = np.concatenate([axes @ command.twist[:3], axes @ command.twist[3:]])
        back = self._way.correction(self.pose(whole), twist, seconds)
        back = np.concatenate([axes.T @ back[:3], axes.T @ back[3:]])
        return replace(command, twist=command.twist + back)

    # -- the motion that is wanted and possible ------------------------------------------------------------------

    def _wanted(self, whole: np.ndarray, velocity: np.ndarray, q: np.ndarray, measured: np.ndarray,
                command: ServoCommand) -> _Wanted:
        """q (k,): the set-points; measured (k,): where the joints are."""
        settings = self.settings
        lost, condition = 0.0, 1.0
        if command.twist is not None and command.twist.any():
            limits = self.limits
            # Where none matters, x does, as in MoveIt's node: something must tell the way.
            keep = np.array([0]) if command.drift.all() else np.flatnonzero(~command.drift)
            turn = command.axes.T @ self._chain_base(whole)[:3, :3]
            arm = ServoArm(*self._chain.arrays, turn, keep, limits.lower, limits.upper, limits.velocity)
            jacobian = jacobian_of(arm, q)
            wanted, metric, lost, condition = velocity_for(
                command.twist[keep], jacobian, arm, q,
                Thresholds(float(settings.lower_singularity_threshold),
                           float(settings.hard_stop_singularity_threshold)))
        else:
            wanted, metric, jacobian = np.array(command.joints, dtype=float), np.eye(len(q)), np.eye(len(q))
        near = self._near(whole, velocity)
        slope = near[1]
        bounds = possible(wanted, metric, (q, measured), self.limits, near, self._rates)
        found = bounds.velocity
        if self.surroundings is not None:
            found = self._open_cells(self.surroundings, whole, found)
        status, reason = self._status(shares(jacobian, wanted, found, slope, bounds), found, lost, condition, bounds)
        if status is Status.JOINT_BOUND:
            behind = np.abs(q - measured)
            if behind.max() > 0.8 * LEAD_RAD:
                reason = ("the arm does not follow: joint %s is %.2f rad behind its set-point; is the robot enabled, "
                          "and does its controller run?" % (self.joints[int(behind.argmax())], behind.max()))
        return _Wanted(found, status, reason, not bounds.is_held, slope, bounds.least)

    def _chain_base(self, whole: np.ndarray) -> np.ndarray:
        """The pose (4, 4) of the chain's base in the model's frame."""
        return self.pose(whole, self._chain.base) if self._base_moves else self.base @ self._base_in_root

    def _near(self, whole: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, ...]:
        """distance (m,), slope (m, k), drift (m,) and of_robot (m,) of what is near, as in ``surroundings.Near``."""
        if self.surroundings is None or not self.settings.check_collisions:
            return self._nothing_near
        near = self.surroundings.near(whole, velocity, _REACH_M)
        return near.distance, np.ascontiguousarray(near.slope[:, self._rows]), near.drift, near.of_robot

    def _open_cells(self, surroundings: Surroundings, whole: np.ndarray, found: np.ndarray) -> np.ndarray:
        """``found``, shortened where it leads into postures at which links may touch that spheres cannot tell apart."""
        ahead = whole.copy()
        if surroundings.closed(whole):
            return found
        for share in (1.0, 0.5, 0.25, 0.0):
            ahead[self._indices] = whole[self._indices] + 2.0 * share * self.settings.stopping_time * found
            if not surroundings.closed(ahead):
                return share * found
        return 0.0 * found

    # -- why -----------------------------------------------------------------------------------------------------

    def _status(self, of_motion, found, lost, condition, bounds: Possible) -> tuple[Status, str]:
        """The greatest reduction of the motion: its Status, and a sentence. of_motion: see ``shares``."""
        taken, left, nearest = of_motion
        low, high = bounds.low, bounds.high
        if taken > _NOTICED and taken >= lost:
            if math.isfinite(nearest):
                return (Status.HALT_FOR_COLLISION if left < _REMAINS else Status.DECELERATE_FOR_COLLISION,
                        "%.0f %% of the motion is held back %.1f cm before a contact" % (
                            100.0 * min(taken, 1.0), 100.0 * max(nearest, 0.0)))
            at = [name for number, name in enumerate(self.joints)
                  if found[number] >= high[number] - 1e-6 < self.limits.velocity[number] - 1e-6
                  or found[number] <= low[number] + 1e-6 > 1e-6 - self.limits.velocity[number]]
            return Status.JOINT_BOUND, "%.0f %% of the motion is held back by the limits of %s" % (
                100.0 * min(taken, 1.0), " and ".join(at) or "the joints")
        if lost >= 1.0 and condition < self.settings.lower_singularity_threshold:
            return Status.HALT_FOR_SINGULARITY, ("the arm's %d joints cannot move the hand in this direction"
                                                 % len(self.joints))
        if lost > _NOTICED:
            return (Status.HALT_FOR_SINGULARITY if lost > 1.0 - _REMAINS else Status.DECELERATE_FOR_SINGULARITY,
                    "%.0f %% of the motion is lost to a singularity, condition number %.0f" % (
                        100.0 * min(lost, 1.0), condition))
        return Status.NO_WARNING, ""


def _at_rest(motion: ServoMotion) -> bool:
    return np.abs(motion.velocity).max() < _AT_REST and np.abs(motion.acceleration).max() < 1e3 * _AT_REST


def _rates(settings: ServoSettings) -> Rates:
    """The Rates of settings, in ``possible``'s words."""
    clearance, threshold = _CLEARANCE_M, (settings.self_collision_proximity_threshold,
                                          settings.scene_collision_proximity_threshold)
    if settings.collision_check_type == STOP_DISTANCE:
        clearance, threshold = max(clearance, settings.min_allowable_collision_distance), (0.0, 0.0)
    times = (max(settings.stopping_time, one / _SPEED_AT_THRESHOLD) for one in threshold)
    return Rates(*map(float, (settings.joint_limit_margin, 1.5 * settings.publish_period, settings.stopping_time,
                              clearance, *times)))


def _steered(model: PlanningModel, name: str) -> tuple[Group, str, str]:
    """The group to steer, and the links at the ends of its chain: base and tip."""
    steerable = [one for one in model.groups.values() if one.tip is not None]
    if not name and len(steerable) == 1:
        name = steerable[0].name
    if name not in model.groups:
        raise SettingsError("move_group_name is '%s'; the groups of robot '%s' are %s"
                            % (name, model.name, ", ".join(model.groups) or "none"))
    group = model.groups[name]
    if group.base is None or group.tip is None:
        raise SettingsError("move_group_name is '%s', which is not one chain; expected one of %s, and a servo for each"
                            % (name, ", ".join(one.name for one in steerable) or "none"))
    return group, group.base, group.tip


def _chain_of(model: PlanningModel, group: Group, base: str, tip: str) -> Chain:
    if group.chain is not None:
        return group.chain
    try:
        return Chain.from_robot(model.robot, base, tip)
    except ChainError as error:
        raise SettingsError("group '%s' cannot be steered: %s" % (group.name, error)) from None
