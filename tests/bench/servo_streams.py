# SPDX-License-Identifier: BSD-3-Clause
"""Random streams of twists through servos to robots in simulated physics: Baxter's two arms at a time, and PROBOT.

Between servo and physics stands what stands there in a lab: the messages of ``moveit_servo.outputs``, Baxter's control
logic or PROBOT's trajectory controller, joint states at their rates. One thread, no master.
"""
from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import rospkg
import yaml

import xacro
from baxter_lab import Lab, Mode
from baxter_lab.descriptions import baxter_srdf, joint_limits
from baxter_model import BASE_HEIGHT_M, SIDES
from bullet_sim import Pose, World
from controller_manager.interfaces import POSITION
from gazebo_ros_control.hardware import SimulatedHardware
from joint_trajectory import Follower, TrajectoryCommand
from loop_ros.testing import FakeLog
from model_files.resources import ResourceFinder
from motion_planning.constraints.regions import rotation_vector
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.planners.planning import sphere_model_of
from motion_planning.scene import Scene, WorldObject
from moveit_servo.convex_parts import ConvexParts, cuts_named
from moveit_servo.outputs import message_of
from moveit_servo.servo import Servo, ServoCommand, ServoStep, Status
from moveit_servo.settings import ServoSettings
from moveit_servo.surroundings import Surroundings
from urdf_model import Box, Cylinder, Inertial, Link, Shape, Sphere, parse_urdf
from urdf_model import Robot as Description
from urdf_model.transforms import axis_rotation

TICK_S, PERIOD_S = 0.002, 0.008
STREAM_S, TWIST_S = 20.0, 1.0
# Standard deviations of twists [m/s, rad/s]; the share of pauses, and of twists along or about one axis alone.
TWIST, PAUSES, SINGLE = np.repeat((0.3, 0.6), 3), 0.1, 0.3
# Joint states in a lab [Hz].
BAXTER_STATES_HZ, PROBOT_STATES_HZ = 100.0, 50.0
# Time in which the hand comes up to its speed, and from then on has the direction that is asked for [s].
SETTLED_S = 0.2
# Of a rotation [rad] that counts as much as a shift [m]: the goals are 2 mm and 0.5 degrees.
LEVER_M = 0.002 / np.radians(0.5)
# A direction is free if this many steps in it move a joint by so much [rad].
PROBE_STEPS, MOVED_RAD = 12, 1e-4
# Ends of the names of joints that are near 0 in a stretched arm.
STRETCHED = ("e1", "w1", "joint_3", "joint_5")
FORCE_N = 5.0
# An arm has come to rest after this time, and is to move within the second [s].
RESTS_S, FIRST_S = 0.5, 0.5
UNDER_FLOOR_M = 0.001


@dataclass(frozen=True)
class Thing:
    """An obstacle: name, shape of urdf_model, place (3,) of its middle in the robot's frame [m]."""

    name: str
    shape: Any
    place: tuple[float, float, float]

    @property
    def pose(self) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = self.place
        return pose


class Physics(Protocol):
    """A robot in simulated physics. arms: {group: settings of its servo}; model, exact: those of planning; parts: links
    that are convex in physics; states_hz: rate of its joint states [Hz]; floor_m: height of the floor in the robot's
    frame."""

    model: PlanningModel
    exact: ExactChecker
    parts: ConvexParts
    arms: dict[str, ServoSettings]
    states_hz: float
    floor_m: float
    #: Radii [m] of the shell about the robot in which things stand, and their size's scale.
    reach: tuple[float, float]
    size: float

    def begin(self, things: list[Thing], q: np.ndarray) -> None:
        """Put the robot at ``q`` (n,) among ``things``, at rest and enabled."""

    def joints(self) -> tuple[dict[str, float], dict[str, float]]:
        """Positions [rad, m] and velocities of the joints by their names."""

    def send(self, group: str, message: Any) -> None:
        """A message of the group's servo."""

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""

    def tick(self) -> float:
        """One step of TICK_S; returns the greatest force of a contact of the robot [N]."""


def settings_of(file: str, **values: str) -> ServoSettings:
    """The settings of a file of moveit_servo, with ``values`` for its arguments."""
    text = (Path(rospkg.RosPack().get_path("moveit_servo")) / "config" / file).read_text()
    for name, value in values.items():
        text = text.replace("$(arg %s)" % name, value)
    return ServoSettings.from_mapping(yaml.safe_load(text))


def parts_of(physics: Physics) -> ConvexParts:
    """The convex parts that the settings of a robot's servos name."""
    settings = next(iter(physics.arms.values()))
    return ConvexParts(sphere_model_of(physics.exact), cuts_named(settings.mesh_cuts, physics.model))


class BaxterPhysics:
    """Baxter as in ``baxter_world.launch``, with both servos of ``baxter_servo.launch``."""

    states_hz, floor_m, reach, size = BAXTER_STATES_HZ, -BASE_HEIGHT_M, (0.45, 1.2), 1.0

    def __init__(self) -> None:
        self.lab = Lab(time_step_s=TICK_S)
        arguments = self.lab.options.arguments()
        self.model = PlanningModel.from_xml(self.lab.robot_urdf, baxter_srdf(arguments), joint_limits())
        self.exact = ExactChecker(self.model, MeshReader(self.lab.find_mesh))
        self.arms = {side + "_arm": settings_of("baxter.yaml", side=side, command_in_type="speed_units")
                     for side in SIDES}
        self.parts = parts_of(self)
        self._things: list[str] = []
        self._robot = self.lab.robot.simulated.model
        # What touches at rest: the pedestal and the floor.
        self._ours = {link for link in self._robot.link_names if link.startswith(SIDES)}

    def begin(self, things: list[Thing], q: np.ndarray) -> None:
        lab = self.lab
        for name in self._things:
            lab.remove(name)
        self._things = [thing.name for thing in things]
        lab.robot.put({side: [q[self.model.index[name]] for name in lab.robot.arms[side].joint_names]
                       for side in SIDES})
        for thing in things:
            shape = thing.shape
            if isinstance(shape, Box):
                lab.add_box(thing.name, shape.size, thing.place)
            elif isinstance(shape, Cylinder):
                lab.add_cylinder(thing.name, shape.radius, shape.length, thing.place)
            else:
                lab.add_sphere(thing.name, shape.radius, thing.place)
        if not lab.robot.is_enabled:
            lab.robot.enable()

    @property
    def time_s(self) -> float:
        return self.lab.time_s

    def joints(self) -> tuple[dict[str, float], dict[str, float]]:
        position, velocity, _ = self._robot.read_joints()
        names = self._robot.joint_names
        return dict(zip(names, position.tolist(), strict=True)), dict(zip(names, velocity.tolist(), strict=True))

    def send(self, group: str, message: Any) -> None:
        self.lab.robot.arms[group.removesuffix("_arm")].command(Mode(message.mode), message.command, message.names)

    def tick(self) -> float:
        self.lab.step()
        return max((one.force for one in self.lab.world.contacts(self._robot)
                    if {one.link_a, one.link_b} & self._ours and not self._of_gripper(one)), default=0.0)

    @staticmethod
    def _of_gripper(contact: Any) -> bool:
        """Whether the two fingers of a closed gripper press each other."""
        return contact.model_a == contact.model_b and "finger" in contact.link_a and "finger" in contact.link_b


class ProbotPhysics:
    """PROBOT and its controller as in ``probot_anno_bringup_moveit.launch``, with ``probot_servo.launch``."""

    states_hz, floor_m, reach, size = PROBOT_STATES_HZ, 0.0, (0.15, 0.5), 0.4

    def __init__(self) -> None:
        packages = rospkg.RosPack()
        urdf = xacro.process_file(packages.get_path("probot_description") + "/urdf/probot_anno.xacro").toxml()
        config = Path(packages.get_path("probot_anno_moveit_config")) / "config"
        self.model = PlanningModel.from_xml(urdf, (config / "probot_anno.srdf").read_text(),
                                            yaml.safe_load((config / "joint_limits.yaml").read_text()))
        self.exact = ExactChecker(self.model, MeshReader(ResourceFinder()))
        self.arms = {"manipulator": settings_of("probot.yaml", command_in_type="speed_units")}
        self.parts = parts_of(self)
        self.world = World(time_step_s=TICK_S, find_mesh=ResourceFinder())
        self.world.add_ground_plane()
        robot = parse_urdf(urdf, source="probot")
        self._robot = self.world.spawn(robot, "probot", Pose(), static=True)
        self._hardware = SimulatedHardware(self._robot, robot, urdf, FakeLog())
        self._follower = Follower(self._hardware.joint_names)
        self._things: list[str] = []

    def begin(self, things: list[Thing], q: np.ndarray) -> None:
        for name in self._things:
            self.world.delete(name)
        self._things = [thing.name for thing in things]
        names = self._hardware.joint_names
        position = np.array([q[self.model.index[name]] for name in names])
        self._robot.set_joint_positions(self._robot.index(names), position)
        self._hardware.joints_set()
        self._follower.start(self.world.time_s, position, np.zeros(len(names)))
        for thing in things:
            shape = Shape(thing.shape, np.eye(4), "shape", (0.7, 0.45, 0.25, 1.0), "link")
            link = Link("link", collisions=[shape], visuals=[shape], inertial=Inertial(1.0, np.zeros(3), np.eye(3)))
            self.world.spawn(Description(thing.name, {"link": link}, {}, "link"), thing.name,
                             Pose(thing.place), static=True)

    @property
    def time_s(self) -> float:
        return self.world.time_s

    def joints(self) -> tuple[dict[str, float], dict[str, float]]:
        position, velocity, _ = self._robot.read_joints()
        names = self._robot.joint_names
        return dict(zip(names, position.tolist(), strict=True)), dict(zip(names, velocity.tolist(), strict=True))

    def send(self, group: str, message: Any) -> None:
        rows = [(point.time_from_start.to_sec(), point.positions, point.velocities, point.accelerations)
                for point in message.points]
        command = TrajectoryCommand(message.joint_names, rows, message.header.stamp.to_sec() or None)
        self._follower.accept(command, self.world.time_s + TICK_S, self._hardware.position)

    def tick(self) -> float:
        hardware = self._hardware
        hardware.read()
        self._follower.update(self.world.time_s + TICK_S, hardware.position, hardware.velocity)
        hardware.command[POSITION][:] = self._follower.desired[0]
        hardware.write(TICK_S)
        self.world.step()
        return max((one.force for one in self.world.contacts(self._robot)), default=0.0)


# -- where a stream begins ------------------------------------------------------------------------------------------

def clutter(physics: Physics, rng: np.random.Generator) -> list[Thing]:
    """A table, and things on it and in the air around the robot."""
    s, floor = physics.size, physics.floor_m
    top = rng.uniform(-0.3, 0.0) * s if floor < 0.0 else 0.1 * s
    things = [Thing("table", Box((0.7 * s, 1.4 * s, 0.04 * s)), (0.85 * s, 0.0, top - 0.02 * s))]
    for number in range(14):
        radius, angle = rng.uniform(*physics.reach), rng.uniform(-2.4, 2.4)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        high = rng.uniform(0.06, 0.3) * s
        on_table = abs(x - 0.85 * s) < 0.3 * s and abs(y) < 0.6 * s
        z = top + 0.5 * high if on_table else rng.uniform(floor + 0.2 * s, 0.9 * s)
        shape = (Box((*(rng.uniform(0.04, 0.15, 2) * s).tolist(), high)), Cylinder(rng.uniform(0.02, 0.06) * s, high),
                 Sphere(rng.uniform(0.03, 0.08) * s))[number % 3]
        things.append(Thing("thing%d" % number, shape, (float(x), float(y), float(z))))
    return things


def start(physics: Physics, rng: np.random.Generator) -> tuple[list[Thing], Scene]:
    """Things, and a scene of them with the robot at a posture anywhere in its range that touches none of them. In a
    quarter of the starts the arm is stretched."""
    model, exact = physics.model, physics.exact
    things = clutter(physics, rng)
    indices = np.concatenate([model.groups[group].indices for group in physics.arms])
    bounds = model.bounds[indices]
    stretched = [k for k, index in enumerate(indices) if model.variables[index].endswith(STRETCHED)]
    # Fingers, for instance, are where they are.
    others = {model.index[name]: at for name, at in physics.joints()[0].items() if name in model.index}
    known, others = np.array(list(others)), np.array(list(others.values()))
    floor = WorldObject("floor", _at(physics.floor_m - UNDER_FLOOR_M - 0.05),
                        ((Box((4.0, 4.0, 0.1)), np.eye(4)),))
    while True:
        q = rng.uniform(*bounds.T)
        if rng.random() < 0.25:
            q[stretched] = np.clip(0.0, *bounds[stretched].T)
        empty = physics.parts.added_to(Scene(model).with_objects([floor]))
        state = empty.state.with_q(others, known).with_q(q, indices)
        if not exact.free(empty, state):
            continue
        kept = [one for one in things if exact.free(
            Scene(model).with_objects([WorldObject(one.name, one.pose, ((one.shape, np.eye(4)),))]), state)]
        objects = [WorldObject(one.name, one.pose, ((one.shape, np.eye(4)),)) for one in kept]
        return kept, empty.with_objects(objects).with_state(state)


def _at(height: float) -> np.ndarray:
    pose = np.eye(4)
    pose[2, 3] = height
    return pose


# -- a stream -------------------------------------------------------------------------------------------------------

@dataclass
class Found:
    """The figures of a stream. cpu_s, together_s: of each step of one arm, and of all arms at a time [s]; share: the
    greatest velocity, acceleration or jerk in shares of its limit; force_n: the greatest of a contact; shift_m,
    turn_rad: the greatest distances of a set-point from the way that was asked for, while nothing was held back;
    hand_m, hand_rad: the same of the hand in the physics; dead_ends: times at which every direction was refused [s]."""

    cpu_s: list[float] = field(default_factory=list)
    together_s: list[float] = field(default_factory=list)
    share: float = 0.0
    force_n: float = 0.0
    touches: bool = False
    shift_m: float = 0.0
    turn_rad: float = 0.0
    hand_m: float = 0.0
    hand_rad: float = 0.0
    dead_ends: list[float] = field(default_factory=list)


class Straight:
    """The way of a hand under one twist, from where it had come up to speed."""

    def __init__(self) -> None:
        self.twist, self.since, self.origin = np.zeros(6), 0.0, None

    def follow(self, pose: np.ndarray, twist: np.ndarray, is_free: bool, now: float) -> tuple[float, float]:
        """Distances [m, rad] of ``pose`` (4, 4) from the way of ``twist`` (6,); 0 while there is none."""
        if not (is_free and twist.any() and np.array_equal(twist, self.twist)):
            self.twist, self.since, self.origin = twist, now, None
            return 0.0, 0.0
        if now - self.since < SETTLED_S:
            return 0.0, 0.0
        if self.origin is None:
            self.origin = pose
            return 0.0, 0.0
        shift = pose[:3, 3] - self.origin[:3, 3]
        turn = rotation_vector(pose[:3, :3] @ self.origin[:3, :3].T)
        along = np.concatenate([twist[:3], LEVER_M * twist[3:]])
        gone = float(along @ np.concatenate([shift, LEVER_M * turn]) / (along @ along))
        angle = float(np.linalg.norm(twist[3:]))
        turned = axis_rotation(twist[3:] / angle, angle * gone) if angle > 0.0 else np.eye(3)
        off = rotation_vector(pose[:3, :3] @ (turned @ self.origin[:3, :3]).T)
        return float(np.linalg.norm(shift - gone * twist[:3])), float(np.linalg.norm(off))


class Steered:
    """One arm of a stream."""

    def __init__(self, physics: Physics, group: str, scene: Scene, rng: np.random.Generator) -> None:
        settings = physics.arms[group]
        surroundings = Surroundings(sphere_model_of(physics.exact), physics.model.groups[group], scene)
        self.group, self.rng, self.twist = group, rng, np.zeros(6)
        self.servo, self._probe = Servo(physics.model, settings), Servo(physics.model, settings)
        self.servo.surroundings = self._probe.surroundings = surroundings
        self.indices = [physics.model.index[name] for name in self.servo.joints]
        self.steps: list[ServoStep] = []
        self.ways = Straight(), Straight()

    def draw(self) -> None:
        """Another twist."""
        rng = self.rng
        twist = rng.normal(size=6) * TWIST
        if rng.random() < SINGLE:
            twist *= np.eye(6)[rng.integers(6)]
        self.twist = twist * (rng.random() > PAUSES)

    def is_stuck(self, q: np.ndarray) -> bool:
        """Whether no direction moves the arm at ``q`` (n,)."""
        probe, still = self._probe, np.zeros(len(q))
        for number in self.rng.permutation(12):
            probe.reset()
            here = q.copy()
            command = ServoCommand(twist=(0.2, -0.2)[number % 2] * np.eye(6)[number // 2])
            for _ in range(PROBE_STEPS):
                here[self.indices] = probe.step(here, still, command, PERIOD_S).position
            if np.abs(here - q)[self.indices].max() > MOVED_RAD:
                return False
        return True


def run(physics: Physics, seed: int, seconds: float = STREAM_S) -> Found:
    """Let the stream of a seed run."""
    rng = np.random.default_rng(seed)
    things, scene = start(physics, rng)
    physics.begin(things, scene.state.q)
    arms = [Steered(physics, group, scene, np.random.default_rng((seed, number)))
            for number, group in enumerate(physics.arms)]
    found, q, velocity = Found(), np.array(scene.state.q), np.zeros(len(scene.state.q))
    model = physics.model
    known = {name: index for name, index in model.index.items() if name in physics.joints()[0]}
    ticks, last_state, postures = round(PERIOD_S / TICK_S), -1.0, []
    for step in range(round(seconds / PERIOD_S)):
        now = step * PERIOD_S
        if int(now * physics.states_hz) != last_state:
            last_state = int(now * physics.states_hz)
            _take(physics.joints(), known, q, velocity)
        if step % round(TWIST_S / PERIOD_S) == 0:
            for arm in arms:
                arm.draw()
                if arm.is_stuck(q):
                    found.dead_ends.append(now)
        _step(physics, arms, q, velocity, now, found)
        if step % 4 == 0:
            postures.append(_posture(q, arms))
        found.force_n = max(found.force_n, *(physics.tick() for _ in range(ticks)))
        exactly = q.copy()
        _take(physics.joints(), known, exactly, velocity.copy())
        for arm in arms:
            _measure(arm, arm.ways[1], arm.servo.pose(exactly), now, found, "hand_m", "hand_rad")
    found.touches = physics.exact.first_blocked(scene, np.array(postures)) is not None
    for arm in arms:
        found.share = max(found.share, _worst(arm))
    return found


def first_motion(physics: Physics, seed: int) -> float:
    """Simulated time [s] from a twist for an arm at rest, whose step a node makes at once, to a joint's first motion
    in the physics. Raises RuntimeError if none moves."""
    rng = np.random.default_rng((seed, 2))
    _, scene = start(physics, rng)
    physics.begin([], scene.state.q)
    arm = Steered(physics, list(physics.arms)[seed % len(physics.arms)], scene, rng)
    for _ in range(round(RESTS_S / TICK_S)):
        physics.tick()
    q, velocity = np.array(scene.state.q), np.zeros(len(scene.state.q))
    known = {name: index for name, index in physics.model.index.items() if name in physics.joints()[0]}
    _take(physics.joints(), known, q, velocity)
    arm.twist, began, here = np.eye(6)[seed % 6] * 0.2, physics.time_s, q.copy()
    for step in range(round(FIRST_S / PERIOD_S)):
        _step(physics, [arm], q, velocity, step * PERIOD_S, Found())
        for _ in range(round(PERIOD_S / TICK_S)):
            physics.tick()
            _take(physics.joints(), known, here, velocity.copy())
            if np.abs(here - q)[arm.indices].max() > MOVED_RAD:
                return physics.time_s - began
    raise RuntimeError("seed %d: no joint has moved within %g s" % (seed, FIRST_S))


def _step(physics: Physics, arms: list[Steered], q: np.ndarray, velocity: np.ndarray, now: float,
          found: Found) -> None:
    """One step of each arm's servo; its set-points go to the physics."""
    together = 0.0
    for arm in arms:
        begin = time.thread_time()
        made = arm.servo.step(q, velocity, ServoCommand(twist=arm.twist), PERIOD_S)
        took = time.thread_time() - begin
        together += took
        found.cpu_s.append(took)
        arm.steps.append(made)
        physics.send(arm.group, message_of(made, q[arm.indices], arm.servo.joints, arm.servo.settings, PERIOD_S,
                                           physics.time_s))
        there = q.copy()
        there[arm.indices] = made.position
        _measure(arm, arm.ways[0], arm.servo.pose(there), now, found, "shift_m", "turn_rad")
    found.together_s.append(together)


def _measure(arm: Steered, way: Straight, pose: np.ndarray, now: float, found: Found, *names: str) -> None:
    is_free = arm.steps[-1].status is Status.NO_WARNING
    for name, value in zip(names, way.follow(pose, arm.twist, is_free, now), strict=True):
        setattr(found, name, max(getattr(found, name), value))


def _take(joints: tuple[dict[str, float], dict[str, float]], known: dict[str, int], q: np.ndarray,
          velocity: np.ndarray) -> None:
    for name, index in known.items():
        q[index], velocity[index] = joints[0][name], joints[1][name]


def _posture(q: np.ndarray, arms: list[Steered]) -> np.ndarray:
    """``q`` with all arms where their set-points are."""
    whole = q.copy()
    for arm in arms:
        whole[arm.indices] = arm.steps[-1].position
    return whole


def _worst(arm: Steered) -> float:
    """The greatest velocity, acceleration or jerk, in shares of its limit."""
    limits = arm.servo.limits
    velocity, acceleration = (np.array([getattr(step, name) for step in arm.steps])
                              for name in ("velocity", "acceleration"))
    return max(float((np.abs(velocity) / limits.velocity).max()),
               float((np.abs(acceleration) / limits.acceleration).max()),
               float((np.abs(np.diff(acceleration, axis=0)) / PERIOD_S / limits.jerk).max()))
