# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's control logic on a simulated model, tick by tick: arms, head, hands, and what keeps the arms from harm.

`plugin.BaxterPlugin` runs it in /gazebo, behind topics; `baxter_lab` runs it without ROS.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from arm_kinematics import Chain, kernels
from baxter_model import BASE_FRAME, SIDES, is_part_of_arm, tip_of
from baxter_model.description import arm_radius, finger_openings, limbs_of

from . import effects, individual
from .arms import endpoint
from .arms.actuators import Actuators
from .arms.external_load import ExternalLoad
from .arms.guarding import Guarding, guards_of
from .arms.hand_load import HandLoads
from .arms.joint_command import ArmLimits
from .arms.joint_sensors import JointSensors
from .arms.measured import Measured
from .arms.safety import Safety
from .errors import CommandRefused
from .grippers.hands import hand_of
from .head import PanDrive
from .robot import BaxterHardware, Behaviour
from .robot_state import Event
from .sensing.noise import HandSensors
from .snapshot import JointSnapshot

if TYPE_CHECKING:
    from bullet_sim import Model, World
    from urdf_model import Robot

    from .arms.safety import Felt
    from .robot_state import BaxterState

kernels.load()  # not within a tick


class Which(NamedTuple):
    """Which robot it is; the package's README explains the parameters of the same names.

    profile: "sim" or "robot"; effects: a text such as "lag,noise", "all" or "none", or None for those of the profile;
    serial: from 0, or a YAML file of numbers; disabled: "hold" or "sink".
    """

    profile: str = "sim"
    effects: str | None = None
    serial: int = individual.DRAWING
    disabled: str = "hold"


def _never(side: str) -> bool:
    return False


class SimulatedBaxter:
    """world, model: of bullet_sim; robot: the model's description (urdf_model.Robot) with all its shapes;
    which: `Which`; before: the robot_state.BaxterState of the robot that this one replaces, or None. Raises
    HardwareError and, for a model that is no BaxterHardware, ModelError.

    Each tick the caller calls `measure`, then passes commands to `baxter`, `head` and the grippers of `hands`, then
    calls `update`, then steps the world. Attributes: `baxter`, a `robot.BaxterHardware`; `head`, a `head.PanDrive`;
    `hands`: {side: one of `grippers.hands`}; `guarding`, an `arms.guarding.Guarding`; `chains`: {side: Chain};
    `limb_index`: {side: (7,) numbers of its joints in the model}; `arm_index`: (14,) of both; `chosen`: the set of
    effects, `numbers`: what `effects.read` returns for them; `seed`: of their chance, 0 without; `hand_sensors`: of the
    effect `noise`, or None; `before`: (position, velocity, effort) of all joints at the last `measure`, None where
    there was none since they were put where they are.
    """

    def __init__(self, world: World, model: Model, robot: Robot, which: Which = Which(),  # noqa: B008 (a tuple)
                 before: BaxterState | None = None, is_squeezed: Callable[[str], bool] = _never) -> None:
        self.world, self.model, self._robot = world, model, robot
        limbs = limbs_of(robot)
        names = tuple(name for limb in limbs for name in limb.joint_names)
        arm = self.arm_index = model.index(names)
        if before is None:
            self._hold_other_joints()
        self.dt = world.time_step_s
        limits = ArmLimits(names, model.lower[arm], model.upper[arm], model.max_velocity[arm], model.max_effort[arm])
        usual = effects.ALL if which.profile == "robot" else effects.NONE
        chosen = self.chosen = effects.chosen(usual if which.effects is None else which.effects)
        rows = self.numbers = effects.read(individual.numbers_of(which.serial)) if chosen else {}
        self.seed = int(world.random.integers(2**32)) if chosen & {"noise", "delay"} else 0
        serial = individual.checked(which.serial)
        self._sensors = JointSensors(rows["noise"], names, self.seed, serial) if "noise" in chosen else None
        self.hand_sensors = HandSensors(rows, serial, self.seed) if "noise" in chosen else None
        behaviour = Behaviour(which.profile, which.disabled, Actuators(rows["lag"], names) if "lag" in chosen else None)
        self.baxter = BaxterHardware(limbs, limits, Measured(self._felt(), self._dynamics), self.dt, behaviour, before)
        self.limb_index = {limb.side: model.index(limb.joint_names) for limb in limbs}
        self.chains = {side: Chain.from_robot(robot, base=BASE_FRAME, tip=tip_of(side)) for side in self.limb_index}
        dead_band = 0.0 if "noise" not in chosen else effects.positive(rows["senses"], "head_dead_band", "head_pan")
        self.head = PanDrive(model, self.dt, dead_band)
        self.hands = {side: hand_of(world, model, side, self.dt, self._is_calibrated(side)) for side in SIDES}
        self._loads = (HandLoads(robot, self.chains, self.limb_index, lambda side: self.hands[side].gripper.load)
                       if self.baxter.actuators is not None else None)
        self.guarding = Guarding(world, model, self.baxter, self.chains, guards_of(robot), self.feel, is_squeezed)
        if "safety" in chosen:
            self._make_safe()
        self.before: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._read_at: np.ndarray | None = None
        self._read = np.empty(0), np.empty(0)
        # The joints that were driven to a position last, as the arms and as the model number them.
        self._driven = self._driven_index = np.empty(0, np.int64)
        if before is not None:
            self.measure_now()
            self.baxter.take_over()

    def _hold_other_joints(self) -> None:
        """Hold the head straight, the fingers open, and all other joints."""
        model, fingers = self.model, finger_openings(self._robot)
        if fingers:
            model.set_joint_positions(model.index(fingers), np.array(list(fingers.values())))
        others = np.setdiff1d(np.arange(len(model.joint_names)), self.arm_index)
        model.drive_position(others, model.read_joints()[0][others], model.max_effort[others])
        model.mark_start()

    def _is_calibrated(self, side: str) -> bool:
        return "uncalibrated" not in self.chosen or bool(
            effects.row(self.numbers["uncalibrated"], "calibrated").get(side))

    def _make_safe(self) -> None:
        model, robot, numbers = self.model, self._robot, self.numbers["safety"]
        surface = [effects.positive(numbers, number, "arm") for number in ("contact_stiffness", "contact_damping")]
        links = {side: [robot.joints[name].child for name in chain.joint_names] for side, chain in self.chains.items()}
        load = ExternalLoad(model, self._as_known, self.dt)
        self.guarding.safety = Safety(self.numbers, load, links, arm_radius(robot))
        for joint in robot.movable_joints():
            if any(is_part_of_arm(joint.child, side) for side in SIDES):
                model.soften(joint.child, *surface)

    # -- the tick

    def measure(self, time_s: float, missing_s: float | None) -> None:
        """Begin a tick at time_s [s]; missing_s: as in `Measured`."""
        joints = self.before = self.model.read_joints()
        measured = self.baxter.measured
        measured.time_s, measured.position, measured.velocity = time_s, self._felt(), joints[1][self.arm_index]
        measured.missing_s = missing_s

    def update(self) -> None:
        """After all commands: the drives of this tick."""
        baxter, model, arm, joints = self.baxter, self.model, self.arm_index, self.before
        if joints is None:
            raise RuntimeError("the joints have not been measured since they were put elsewhere: call measure() first")
        measured = baxter.measured
        self.guarding.update(measured.time_s, baxter.state.enabled, joints)
        if baxter.moves_by_gravity:
            efforts = model.gravity_efforts(joints[0])
            self._as_known(efforts, joints[0])
            measured.gravity = efforts[arm]
        drives = baxter.update()
        if len(drives.position_driven):
            if drives.position_driven is not self._driven:
                self._driven, self._driven_index = drives.position_driven, arm[drives.position_driven]
            goal = drives.position
            if self._sensors is not None:
                goal = self._sensors.reached(goal, drives.position_driven)
            model.drive_position(self._driven_index, goal, drives.effort, velocity=drives.velocity)
        if len(drives.velocity_driven):
            model.drive_velocity(arm[drives.velocity_driven], drives.push_velocity, drives.push_effort)
        if len(drives.effort_driven):
            model.drive_effort(arm[drives.effort_driven], drives.exerted)
        self.head.update()
        for hand in self.hands.values():
            hand.update(joints)

    # -- between two ticks

    def apply(self, event: Event) -> None:
        """Take an `Event`. Raises CommandRefused if the state does not allow it, and for a physical robot's arms in the
        field around the head."""
        self.measure_now()
        state = self.baxter.state
        if event is Event.ENABLE and not state.enabled and self.baxter.profile == "robot":
            near = self.guarding.too_near()
            if near:
                raise CommandRefused(near)
        before = state.state
        self.baxter.apply(event)
        if state.state is not before and not state.enabled:
            self.head.stop()
            for hand in self.hands.values():
                hand.stop()

    def measure_now(self) -> None:
        """Update the measured state of the arms' joints."""
        measured = self.baxter.measured
        measured.time_s = self.world.time_s
        measured.position, measured.velocity = self._felt(), self.model.read_joints()[1][self.arm_index]

    def put_elsewhere(self) -> None:
        """The joints were put elsewhere, at rest: forget every command, and hold them there."""
        self.before = None
        self.measure_now()
        self.baxter.put_elsewhere()
        self.guarding.forget()
        self.head.reset()
        for hand in self.hands.values():
            hand.reset()

    def begin_noise(self, seed: int) -> None:
        """Go on with other noise of the sensors; nothing without the effect `noise`. seed: integer from 0."""
        if self._sensors is not None and self.hand_sensors is not None:
            self.seed, self._read_at = seed, None
            self._sensors.begin_again(seed)
            self.hand_sensors.begin_again(seed)

    def readings(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) positions [rad, m] and velocities [rad/s, m/s] of all joints as the robot's sensors have them: the true
        ones without the effect `noise`."""
        position, velocity, effort = self.model.read_joints()
        if self._sensors is None:
            return position, velocity
        if position is not self._read_at:  # programs ask for them many times in a tick
            self._read_at, self._read = position, self._sense(position, velocity, effort)[:2]
        return self._read

    def drive_again(self) -> None:
        """Send head and fingers where they were sent last: after a return to an earlier state of the world."""
        self.head.drive_again()
        for hand in self.hands.values():
            hand.drive_again()

    def hold(self) -> None:
        """Keep the arms where they are, by the simplest means: something here has failed."""
        self.baxter.state.fail()
        arm = self.arm_index
        self.model.drive_position(arm, self.model.read_joints()[0][arm], self.model.max_effort[arm])

    def snapshot(self) -> JointSnapshot:
        """The joints after a step."""
        return JointSnapshot(self.model, self.before, self.dt, self._sense, self._as_known)

    def feel(self, side: str, snapshot: JointSnapshot | Felt) -> tuple[np.ndarray, np.ndarray]:
        """External (torques (7,) [Nm], wrench (6,) [N, Nm] in `base`) on one arm's joints and on its tip."""
        index = self.limb_index[side]
        jacobian = self.chains[side].jacobian(snapshot.position[index])
        return (snapshot.own_effort[index] - snapshot.effort[index],
                endpoint.contact_wrench(jacobian, snapshot.effort[index], snapshot.own_effort[index]))

    # -- inside

    def _dynamics(self, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The function `dynamics` of `Measured`."""
        model, arm = self.model, self.arm_index
        position, velocities = model.read_joints()[0], np.zeros(len(model.joint_names))
        velocities[arm] = velocity
        return model.mass_matrix(position)[np.ix_(arm, arm)], model.inverse_dynamics(position, velocities)[arm]

    def _as_known(self, efforts: np.ndarray, position: np.ndarray) -> None:
        """Make efforts (n,), which balance all that the description has, those that the controllers know of."""
        if self._loads is not None:
            self._loads.correct(efforts, position, self._gravity_in_base)

    def _gravity_in_base(self) -> np.ndarray:
        to_base = self.model.link_pose(BASE_FRAME).matrix()[:3, :3].T
        return to_base @ np.array(self.world.gravity)

    def _sense(self, position: np.ndarray, velocity: np.ndarray,
               effort: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The robot's readings of its joints, (n,) each, where they are as given."""
        arm, actuators = self.arm_index, self.baxter.actuators
        if actuators is not None:
            effort = effort.copy()
            effort[arm] += actuators.counterbalance(position[arm]) + actuators.hysteresis
        if self._sensors is not None:
            position, velocity, effort = position.copy(), velocity.copy(), effort.copy()
            position[arm], velocity[arm], effort[arm] = self._sensors.read(
                self.world.tick, position[arm], velocity[arm], effort[arm])
        return position, velocity, effort

    def _felt(self) -> np.ndarray:
        """(n,) [rad] where the arms' joints are, as their controllers have it."""
        position = self.model.read_joints()[0][self.arm_index]
        return position if self._sensors is None else self._sensors.felt(position)
