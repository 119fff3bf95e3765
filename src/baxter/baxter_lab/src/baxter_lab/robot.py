# SPDX-License-Identifier: BSD-3-Clause
"""Baxter for programs in the same process: arms, grippers, head. What it decides is `baxter_sim_hardware`'s."""
from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from arm_kinematics import NoSolution, solve, solve_as_vendor
from baxter_model import JOINTS, SIDES
from baxter_sim_hardware.arms.joint_command import CheckedCommand, Mode
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.robot_state import BaxterState, Event
from baxter_sim_hardware.simulated import SimulatedBaxter

from .errors import LabError

__all__ = ["Arm", "Baxter", "CommandRefused", "Event", "Gripper", "Head", "Mode", "NoSolution", "BaxterState"]

#: An arm is there when each joint is so near [rad], and so slow [rad/s].
ARRIVED_RAD, AT_REST_RAD_S = 0.0087, 0.02
MOVE_S, GRIP_S, CALIBRATION_S = 15.0, 3.0, 10.0  # [simulated s] that a motion may take
#: A gripper tells of a command's motion after so many ticks.
_NOTICED_TICKS = 10


class Gripper:
    """One hand. `wait(condition, within_s, what)`: steps the world until the condition holds."""

    def __init__(self, simulated: SimulatedBaxter, side: str, wait: Callable):
        self._simulated, self._side, self._wait = simulated, side, wait
        self._hand, self._sequence = simulated.hands[side], 0

    def command(self, command: str, **arguments) -> None:
        """One command by its name on the wire: grip, go, release, calibrate, configure ... with its arguments. Raises
        CommandRefused."""
        self._sequence += 1
        self._hand.gripper.take(command, json.dumps(arguments) if arguments else "", "baxter_lab", self._sequence,
                                self._simulated.baxter.state.enabled)

    @property
    def position(self) -> float:
        """How far it is open, 0 to 100 [%]; 0 of a suction gripper."""
        return self._hand.opening(self._simulated.model.read_joints()[0])

    @property
    def force(self) -> float:
        """How hard the fingers press, 0 to 100 [%]; 0 of a suction gripper."""
        return self._hand.readings(self._simulated.model.read_joints()[0])[1]

    @property
    def is_moving(self) -> bool:
        """Whether the fingers move."""
        return bool(self._hand.gripper.flags.get("moving"))

    @property
    def holds(self) -> bool:
        """Whether it holds something."""
        return bool(self._hand.gripper.flags.get("gripping"))

    def go(self, position: float) -> None:
        """Send the fingers to a position, 0 (closed) to 100 (open) [%]. Raises CommandRefused."""
        self.command("go", position=float(position))

    def open(self) -> None:
        """Open it, or let go, and wait. Raises CommandRefused, NotReached."""
        self.command("release")
        self._rest()

    def close(self) -> None:
        """Close it on what is between the fingers, or suck, and wait; then `holds`. Raises CommandRefused,
        NotReached."""
        self.command("grip")
        self._rest()

    def calibrate(self) -> None:
        """Find the ends of the fingers' travel, and wait; nothing where they are known. The physical robot's takes no
        other command before. Raises CommandRefused, NotReached."""
        if self._hand.gripper.flags.get("calibrated", True):
            return
        self.command("calibrate")
        self._wait(lambda: self._hand.gripper.flags["calibrated"], CALIBRATION_S,
                   "the calibration of the %s gripper" % self._side)

    def _rest(self):
        ticks = iter(range(_NOTICED_TICKS))
        self._wait(lambda: next(ticks, None) is None, GRIP_S, "the ticks after a command")
        self._wait(lambda: not self.is_moving, GRIP_S, "rest of the %s gripper" % self._side)


class Arm:
    """One arm. Poses (4, 4) are of its `<side>_gripper` in `base` [m]; angles (7,) go from s0 to w2 [rad].

    Attributes: `side`, `joint_names`, `chain` (`arm_kinematics.Chain`), `gripper`.
    """

    def __init__(self, simulated: SimulatedBaxter, side: str, wait: Callable):
        self._simulated, self._wait, self.side = simulated, wait, side
        self.chain = simulated.chains[side]
        self.joint_names = self.chain.joint_names
        self.gripper = Gripper(simulated, side, wait)
        self._index = simulated.limb_index[side]
        self._posed_at: np.ndarray | None = None
        self._pose = np.eye(4)

    @property
    def angles(self) -> np.ndarray:
        """(7,) [rad], as the robot's sensors have them."""
        return self._simulated.readings()[0][self._index]

    @property
    def velocities(self) -> np.ndarray:
        """(7,) [rad/s], as the robot's sensors have them."""
        return self._simulated.readings()[1][self._index]

    @property
    def efforts(self) -> np.ndarray:
        """(7,) [Nm] of the drives in the last step."""
        return self._simulated.model.read_joints()[2][self._index]

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) of the gripper's frame in `base`, where the sensors of its joints have it."""
        positions = self._simulated.readings()[0]
        if positions is not self._posed_at:  # rewards and observations ask for it many times in a tick
            self._posed_at, self._pose = positions, self.chain.fk(positions[self._index])
        return self._pose.copy()

    @property
    def wrench(self) -> np.ndarray:
        """(6,) force [N] and torque [Nm] of the surroundings on the hand, in `base`."""
        return self._simulated.feel(self.side, self._simulated.snapshot())[1]

    @property
    def modes(self) -> list[Mode]:
        """The command mode of each joint."""
        return [Mode(mode) for mode in self._simulated.baxter.arms.modes(self.side)]

    def command(self, mode: Mode, values: Sequence[float] | np.ndarray,
                names: Sequence[str] | None = None) -> CheckedCommand:
        """One joint command, as on ``joint_command``: `values` [rad, rad/s or Nm] for `names`, by default all joints.

        Streamed modes expire after 0.2 s. Returns the command as the robot took it, whose ``clamped`` names the joints
        that were clamped to their limits. Raises CommandRefused.
        """
        names = list(self.joint_names if names is None else names)
        self._simulated.measure_now()
        return self._simulated.baxter.command(self.side, mode, names, [float(value) for value in values])

    def set_speed_ratio(self, ratio: float) -> None:
        """Share of the joints' speed that position mode uses, 0 to 1. Raises CommandRefused for NaN."""
        self._simulated.baxter.arms.set_speed_ratio(self.side, ratio)

    def ik(self, pose: np.ndarray, seed: Sequence[float] | None = None, as_vendor: bool = False) -> np.ndarray:
        """(7,) the angles nearest to `seed` (default: where the arm is) that put the gripper's frame at `pose` (4, 4).

        `as_vendor`: what the robot's own service would answer. Raises NoSolution, which says why there is none, and
        InvalidTarget for what is no pose.
        """
        start = np.asarray(self.angles if seed is None else seed, dtype=float)
        return (solve_as_vendor if as_vendor else solve)(self.chain, pose, start).q

    def move(self, goal: np.ndarray, within_s: float = MOVE_S) -> None:
        """Move straight in joint space to a pose (4, 4) or angles (7,), and wait until the arm rests there.

        It avoids nothing but the robot itself: ``Lab.plan`` does. Raises NoSolution, CommandRefused, NotReached.
        """
        goal = np.asarray(goal, dtype=float)
        if goal.shape not in ((4, 4), (len(JOINTS),)):
            raise LabError("a goal is a pose (4, 4) or angles (%d,); found an array %s" % (len(JOINTS), goal.shape))
        target = goal if goal.ndim == 1 else self.ik(goal)
        taken = np.clip(target, self.chain.lower, self.chain.upper)
        self.command(Mode.POSITION, target)
        self._wait(lambda: self.is_at(taken), within_s, "the %s arm at its goal" % self.side)

    def is_at(self, angles: np.ndarray) -> bool:
        """Whether the arm rests at `angles` (7,)."""
        return bool(np.abs(self.angles - angles).max() < ARRIVED_RAD and np.abs(self.velocities).max() < AT_REST_RAD_S)


class Head:
    """The head."""

    def __init__(self, simulated: SimulatedBaxter):
        self._simulated = simulated

    @property
    def pan(self) -> float:
        """Where it is turned [rad]."""
        return float(self._simulated.model.read_joints()[0][self._simulated.head.joint])

    def turn(self, pan: float, speed_ratio: float = 1.0) -> None:
        """Turn to `pan` [rad], clamped to the limits. Raises CommandRefused."""
        self._simulated.baxter.state.require_enabled()
        self._simulated.head.head.command_pan(pan, speed_ratio)


class Baxter:
    """The robot. Attributes: `arms`: {side: Arm}, also `left` and `right`; `head`; `simulated`, all below."""

    def __init__(self, simulated: SimulatedBaxter, wait: Callable):
        self.simulated = simulated
        self.arms = {side: Arm(simulated, side, wait) for side in SIDES}
        self.left, self.right = (self.arms[side] for side in SIDES)
        self.head = Head(simulated)

    @property
    def state(self) -> BaxterState:
        """Enabled, disabled, stopped ..."""
        return self.simulated.baxter.state.state

    @property
    def is_enabled(self) -> bool:
        """Whether the arms take commands."""
        return self.simulated.baxter.state.enabled

    def apply(self, event: Event) -> None:
        """Take an event; raises CommandRefused, which says what to do, where the state does not allow it."""
        self.simulated.apply(event)

    def enable(self) -> None:
        """Enable it. Raises CommandRefused."""
        self.apply(Event.ENABLE)

    def disable(self) -> None:
        """Disable it: the arms hold."""
        self.apply(Event.DISABLE)

    def put(self, angles: Mapping[str, Sequence[float] | np.ndarray]) -> None:
        """Put arms at angles {side: (7,)} at once, at rest; commands are forgotten. Nothing in between is simulated."""
        model = self.simulated.model
        for side, values in angles.items():
            model.set_joint_positions(self.simulated.limb_index[side], np.asarray(values, dtype=float))
        self.simulated.put_elsewhere()

    def joint_state(self) -> dict[str, tuple[float, float, float]]:
        """{joint: (position, velocity, effort)} as the robot's own sensors have them [rad, m; rad/s, m/s; Nm, N]."""
        sensed = self.simulated.snapshot().sensed
        return dict(zip(self.simulated.model.joint_names, zip(*(values.tolist() for values in sensed), strict=True),
                        strict=True))

    def __repr__(self) -> str:
        return "Baxter (%s, head at %.2f rad)" % (self.state.value, self.head.pan)
