# SPDX-License-Identifier: BSD-3-Clause
"""An environment without Gymnasium: a task in a lab, with actions, observations, rewards, and exact states."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from baxter_lab import Lab, LabError, Options
from baxter_lab.saving import restorer
from baxter_model import SIDES, poses
from urdf_model.transforms import quaternion_from_matrix

from .controls import ArmControl, action_size, checked
from .looking import outside_picture
from .randomised import Randomised, Randomiser
from .tasks import TASKS, robosuite_start

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from baxter_lab.saving import SavedState

    from .randomised import EpisodeDraw

# Set-points are streamed at 100 Hz, as programs on the robot do.
STREAM_S = 0.01
OBSERVATIONS = ("state", "environment_state_agent_pos", "pixels", "pixels_agent_pos")
CAMERAS = ("head", "left_hand", "right_hand")


class Choices(NamedTuple):
    """control: one of `controls.CONTROLS`; control_freq: actions a second [Hz]; physics_step_s: a tick of physics and
    control logic [s], of which an action has a whole number; obs_type: one of OBSERVATIONS; cameras: of CAMERAS, each a
    picture of `size` x `size`; robosuite_order: the right arm first; options: of the robot; randomised: what differs
    from episode to episode.

    With ticks of 0.002 s, as in /gazebo, an action takes 2.5 times as long to compute as with 0.005 s. In free motion
    the hands are then within 0.1 mm of where they are with the other."""

    control: str = "joint_delta"
    control_freq: int = 20
    physics_step_s: float = 0.005
    obs_type: str = "state"
    cameras: tuple = CAMERAS
    size: int = 84
    robosuite_order: bool = False
    options: Options = Options()
    randomised: Randomised = Randomised()


class Stepped(NamedTuple):
    """Of one action: observation, reward (0 to 1), whether the task is done."""

    observation: dict
    reward: float
    succeeded: bool


class CoreState(NamedTuple):
    """The whole state of a `Core`, made by its `save`: of the lab, and of what is not in it."""

    lab: SavedState
    controls: list[Callable[[], object]]
    goal: dict[str, Any]
    drawn: EpisodeDraw


class Core:
    """task: a name in `tasks.TASKS`; choices: `Choices`. Raises ValueError for what is none of them, MeshesMissing."""

    def __init__(self, task: str, choices: Choices = Choices()) -> None:  # noqa: B008 (a tuple)
        if task not in TASKS:
            raise ValueError("task is %r; choices are %s" % (task, ", ".join(TASKS)))
        _require(choices)
        self.choices, self._ticks = choices, _ticks(choices)
        self._stream_ticks = max(round(STREAM_S / choices.physics_step_s), 1)
        self.action_size = action_size(choices.control)  # before a world is made, as all refusals
        self.sides = SIDES[::-1] if choices.robosuite_order else SIDES
        options = TASKS[task].robot(choices.options)
        self.lab = Lab(options, time_step_s=choices.physics_step_s)
        try:
            self._furnish(task, options)
        except Exception:
            self.lab.close()
            raise

    def _furnish(self, task: str, options: Options) -> None:
        choices = self.choices
        self.task = TASKS[task](self.lab)
        self._start_robot()
        self._controls = [ArmControl(self.lab.robot.arms[side], choices.control,
                                     has_gripper=getattr(options, "%s_gripper" % side) != "none")
                          for side in self.sides]
        self._randomiser = Randomiser(choices.randomised, self.lab, choices.cameras)
        self._start = self.lab.save()

    def _start_robot(self) -> None:
        table = poses()
        start = robosuite_start() if self.task.POSE is None else {
            side: np.array(list(table.angles(self.task.POSE, side).values())) for side in SIDES}
        self.lab.robot.enable()
        for arm in self.lab.robot.arms.values():
            arm.gripper.calibrate()
        self.lab.robot.put(start)

    @property
    def _is_randomised(self) -> bool:
        return self.choices.randomised != Randomised()

    @property
    def steps(self) -> int:
        """Actions of an episode."""
        return self.task.STEPS

    def close(self) -> None:
        """End the world."""
        self.lab.close()

    def reset(self, random: np.random.Generator) -> dict:
        """Begin an episode by `random`; returns the observation. What was before has no influence, to the last bit."""
        self.lab.restore(self._start)
        self.task.begin(random)
        if self._is_randomised:
            self._randomiser.draw(random)  # after the task, whose places are then those without it
        simulated = self.lab.robot.simulated
        if "noise" in simulated.chosen:  # a tick's noise follows from its number, which begins again
            simulated.begin_noise(int(random.integers(2**32)))
        for control in self._controls:
            control.reset()
        return self.observation()

    def step(self, action: Sequence[float] | np.ndarray) -> Stepped:
        """One action, (action_size,) of numbers from -1 to 1. Raises ValueError."""
        action = checked(action, self.action_size)
        begins = [control.target.copy() for control in self._controls]
        for control, part in zip(self._controls, np.split(action, len(self._controls)), strict=True):
            control.take(part)
        for tick in range(self._ticks):
            if tick % self._stream_ticks == 0:
                share = min((tick + self._stream_ticks) / self._ticks, 1.0)
                for control, begin in zip(self._controls, begins, strict=True):
                    control.send(share, begin)
            self.lab.step()
        return Stepped(self.observation(), self.task.reward(), self.task.succeeded())

    # -- what is observed

    def observation(self) -> dict:
        """{"state": (n,) float64}, or what obs_type names of {"pixels": {camera: (size, size, 3) uint8},
        "agent_pos": (n,), "environment_state": (m,)}."""
        kind, size = self.choices.obs_type, self.choices.size
        if kind == "state":
            return {"state": np.concatenate([self.agent_pos(), self.task.observed()])}
        found: dict = {}
        if "pixels" in kind:
            found["pixels"] = {name: self._randomiser.take(name, size) for name in self.choices.cameras}
        if "agent_pos" in kind:
            found["agent_pos"] = self.agent_pos()
        if "environment_state" in kind:
            found["environment_state"] = self.task.observed()
        return found

    def agent_pos(self) -> np.ndarray:
        """Of each arm, in the actions' order: angles (7) [rad], speeds (7) [rad/s], the hand's place (3) [m] and
        quaternion x y z w, how far the gripper is open, 0 to 1."""
        parts = []
        for side in self.sides:
            arm = self.lab.robot.arms[side]
            pose = arm.pose
            parts += [arm.angles, arm.velocities, pose[:3, 3], quaternion_from_matrix(pose),
                      (arm.gripper.position / 100.0,)]
        return np.concatenate(parts)

    def look(self, width: int, height: int) -> np.ndarray:
        """A picture for people, from outside, (height, width, 3) uint8, with a ball where the task's goal is."""
        goal = getattr(self.task, "goal", None)
        return outside_picture(self.lab, width, height, goal, getattr(self.task, "WITHIN_M", 0.0))

    # -- states

    def save(self) -> CoreState:
        """The whole state: the physics, the robot's control logic, the task's. It cannot leave this process."""
        logic = [restorer(vars(control)) for control in self._controls]
        goal = {name: value for name, value in vars(self.task).items() if name == "goal"}
        return CoreState(self.lab.save(), logic, goal, self._randomiser.drawn)

    def restore(self, state: CoreState) -> dict:
        """Return to a state of this environment; returns the observation. Equal actions then give equal numbers, bit
        for bit. Raises LabError for what this environment has not saved."""
        if not isinstance(state, CoreState):
            text = "an environment returns to states of its own save(); found %r" % (state,)
            raise LabError(text)  # as in `controls.checked`
        self.lab.restore(state.lab)
        if self._is_randomised:
            self._randomiser.put(state.drawn)
        for again in state.controls:
            again()
        vars(self.task).update(state.goal)
        return self.observation()


def _require(choices: Choices) -> None:
    """Before a world is made: raises ValueError for choices that are none."""
    if choices.obs_type not in OBSERVATIONS:
        raise ValueError("obs_type is %r; choices are %s" % (choices.obs_type, ", ".join(OBSERVATIONS)))
    if not isinstance(choices.cameras, (list, tuple)) or not set(choices.cameras) <= set(CAMERAS):
        raise ValueError("cameras is %r; it must be a list of some of %s" % (choices.cameras, ", ".join(CAMERAS)))
    for name, kind in (("options", Options), ("randomised", Randomised)):
        if not isinstance(getattr(choices, name), kind):
            raise ValueError("%s is %r; it must be a %s.%s(...)" % (
                name, getattr(choices, name), kind.__module__.partition(".")[0], kind.__name__))
    choices.randomised.require()
    whole, real = (int, np.integer), (int, float, np.integer, np.floating)
    for name, kinds in (("size", whole), ("control_freq", real), ("physics_step_s", real)):
        value = getattr(choices, name)
        if isinstance(value, bool) or not isinstance(value, kinds) or not 0 < value < math.inf:
            raise ValueError("%s is %r; it must be a %snumber above 0" % (name, value, "whole " * (kinds is whole)))
    if not isinstance(choices.robosuite_order, (bool, np.bool_)):
        raise ValueError("robosuite_order is %r; it must be True or False" % (choices.robosuite_order,))


def _ticks(choices: Choices) -> int:
    """Ticks of an action. Raises ValueError unless it is a whole number."""
    rate, step = choices.control_freq, choices.physics_step_s
    ticks = 1.0 / (step * rate) if rate > 0 and step > 0 else 0.0
    if not 0.999 < ticks < math.inf or abs(ticks - round(ticks)) > 1e-6:
        raise ValueError("control_freq is %r Hz with physics_step_s %r s; 1 / (control_freq * physics_step_s) must be "
                         "a whole number" % (rate, step))
    return round(ticks)
