# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations in the environments of gym_baxter: recorded of an expert, and replayed. In lock-step, bit for bit."""
from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np

from baxter_lab import Options, Which
from gym_baxter.core import CAMERAS, Choices, Core
from gym_baxter.names import action_names, robot_names
from gym_baxter.randomised import Randomised
from gym_baxter.tasks import TASKS

from .experts import CONTROL, EXPERTS, Expert
from .frames import (
    ACTION,
    DONE,
    ENVIRONMENT,
    EXPERT_ACTION,
    PICTURES,
    REWARD,
    STATE,
    SUCCESS,
    DemonstrationError,
    Episode,
    Feature,
    Schema,
    numbers,
    picture,
)

#: Disturbances of actions: their size at most, as shares of a full shift or joint, and of a full turn; how much of it
#: is left in the next; for so many actions they come or stay away; how much of the rest they come or go in one action,
#: for drives do not follow what comes at once.
_NOISE, _TURN_NOISE, _LASTING, _STRETCH, _COMING = 0.08, 0.02, 0.9, 10, 0.3
#: A student acts for so many actions of an episode at most; then the expert ends it.
STUDENT_STEPS = 160
_ONE = {REWARD: "float32", DONE: "bool", SUCCESS: "bool"}
#: Of the robot, by which demonstrations are made.
PROFILES = ("sim", "robot")
#: How much differs with --randomised.
RANDOMISED = {"mass": 0.5, "friction": 0.5}


class CorrectedPolicy(Protocol):
    """A policy for an expert to correct: it acts on (n,) numbers, the robot's and those of the things."""

    def begin(self) -> None:
        """An episode begins."""

    def act(self, observation: np.ndarray) -> np.ndarray:
        """(action,) for an observation."""
        ...


class Conditions(NamedTuple):
    """profile: of the robot, sim or robot; randomised: what differs from episode to episode, by the names of
    `gym_baxter.randomised.Randomised`."""

    profile: str = "sim"
    randomised: Mapping[str, float] = MappingProxyType({})

    @classmethod
    def named(cls, profile: str, randomised: bool) -> Conditions:
        """As command lines name them."""
        return cls(profile, RANDOMISED if randomised else {})

    @classmethod
    def of(cls, about: Mapping[str, Any]) -> Conditions:
        """Those of a set, from its `Schema.about`, which a file has. Raises DemonstrationError."""
        profile, randomised = about.get("profile", cls().profile), about.get("randomised", {})
        if profile not in PROFILES:
            raise DemonstrationError("the set's profile is %r; it must be one of %s" % (profile, ", ".join(PROFILES)))
        if not isinstance(randomised, dict) or not randomised.keys() <= set(Randomised._fields):
            raise DemonstrationError("the set's randomised is %r; it must be a table of %s" % (
                randomised, ", ".join(Randomised._fields)))
        try:
            Randomised(**randomised).require()
        except (TypeError, ValueError) as error:
            raise DemonstrationError("the set's conditions: %s" % error) from error
        return cls(profile, randomised)

    @property
    def about(self) -> dict[str, Any]:
        """Their part of `Schema.about`: nothing of usual ones."""
        return {name: value for name, value in (("profile", self.profile), ("randomised", dict(self.randomised)))
                if value != getattr(Conditions(), name)}

    @property
    def choices(self) -> dict[str, Any]:
        """Of `Core`."""
        return {"options": Options(which=Which(profile=self.profile)), "randomised": Randomised(**self.randomised)}

    def __str__(self) -> str:
        return "profile %s%s" % (self.profile, ", " + ", ".join(
            "%s %g" % item for item in self.randomised.items()) if self.randomised else "")


def core_of(task: str, control: str = CONTROL, cameras: tuple[str, ...] = (), size: int = 84, **choices: Any) -> Core:
    """An environment to record in; cameras: of gym_baxter, none by default. Raises DemonstrationError."""
    if task not in TASKS:
        raise DemonstrationError("there is no task %r; choices are %s" % (task, ", ".join(TASKS)))
    if unknown := set(cameras) - set(CAMERAS):
        raise DemonstrationError("there is no camera %s; choices are %s" % (", ".join(unknown), ", ".join(CAMERAS)))
    try:
        return Core(task, Choices(control, obs_type="pixels_agent_pos" if cameras else "state", cameras=cameras,
                                  size=size, **choices))
    except ValueError as error:
        raise DemonstrationError("there is no such environment: %s" % error) from error


def schema_of(core: Core, with_expert: bool = False) -> Schema:
    """The frames of an environment; with_expert: the expert's own action is beside the executed one."""
    choices, task = core.choices, core.task
    observed = task.OBSERVED or tuple(("thing.%d" % n, "") for n in range(len(task.observed())))
    action = numbers(action_names(choices.control, core.sides))
    features: dict[str, Feature] = {ACTION: action, STATE: numbers(robot_names(core.sides)),
                                    ENVIRONMENT: numbers(observed)}
    if with_expert:
        features[EXPERT_ACTION] = action
    if choices.obs_type != "state":
        features |= {PICTURES + camera: picture(choices.size, choices.size) for camera in choices.cameras}
    features |= {key: Feature(dtype, (1,)) for key, dtype in _ONE.items()}
    randomised = {name: value for name, value in choices.randomised._asdict().items() if value}
    about = {"task": task.NAME, "control": choices.control, "robosuite_order": choices.robosuite_order,
             **Conditions(choices.options.which.profile, randomised).about}
    return Schema(choices.control_freq, features, about=about)


def observed(core: Core) -> dict[str, np.ndarray]:
    """A frame's entries before its action."""
    frame = {STATE: core.agent_pos(), ENVIRONMENT: core.task.observed()}
    if core.choices.obs_type != "state":
        frame |= {PICTURES + camera: pixels for camera, pixels in core.observation()["pixels"].items()}
    return frame


class Disturbance:
    """Adds to the motions of `sides`, not to grippers, what an expert has to correct: smooth, in half of the time,
    and of another size in each episode, at most `level`, 0 to 1."""

    def __init__(self, core: Core, sides: tuple[str, ...], seed: int, level: float):
        self._random = np.random.default_rng((seed, 1))
        names = [name for name, _ in action_names(core.choices.control, core.sides)]
        sizes = [_TURN_NOISE if name[-2:] in ("rx", "ry", "rz") else _NOISE for name in names]
        moved = [name.startswith(sides) and "gripper" not in name for name in names]
        self._sizes = level * self._random.uniform() * np.array(sizes) * moved
        self._now, self._count, self._is_on, self._share = np.zeros(len(names)), 0, False, 0.0

    def on(self, action: np.ndarray) -> np.ndarray:
        """The disturbed action."""
        if self._count % _STRETCH == 0:
            self._is_on = bool(self._random.uniform() < 0.5)
        self._count += 1
        fresh = self._random.standard_normal(len(self._now)) * self._sizes * np.sqrt(1.0 - _LASTING**2)
        self._now = _LASTING * self._now + fresh
        self._share += _COMING * (self._is_on - self._share)
        return action + self._share * self._now


def record(core: Core, expert: Expert, seed: int, noise: float = 0.0, sink: Any = None,
           student: CorrectedPolicy | None = None) -> Episode:
    """One episode of an expert. noise: 0 to 1, of `Disturbance`; student: acts first, and the expert ends what it began
    (Ross et al., *A Reduction of Imitation Learning and Structured Prediction to No-Regret Online Learning*, 2011);
    with either, `expert.action` has what the expert wanted. sink: gets each frame as well, `SetWriter.frame` for
    pictures."""
    core.reset(np.random.default_rng(seed))
    expert.begin()
    if student is not None:
        student.begin()
    disturbance = Disturbance(core, expert.MOVED, seed, noise * expert.pace.noise)
    rows: dict[str, list] = {}
    stepped = None
    for count in range(min(core.steps, expert.pace.steps)):
        wanted = np.clip(expert.act(), -1.0, 1.0)
        frame = observed(core)
        if student is not None and count < STUDENT_STEPS:
            done = student.act(np.concatenate([frame[STATE], frame[ENVIRONMENT]]))
        else:
            done = disturbance.on(wanted) if noise else wanted
        action = np.clip(done, -1.0, 1.0).astype(np.float32)
        frame = {ACTION: action, **frame}
        if noise or student is not None:
            frame[EXPERT_ACTION] = wanted.astype(np.float32)
        stepped = core.step(action)
        frame |= {REWARD: [stepped.reward], DONE: [stepped.succeeded], SUCCESS: [stepped.succeeded]}
        if sink is not None:
            sink(frame)
        for key, value in frame.items():
            if not key.startswith(PICTURES):
                rows.setdefault(key, []).append(value)
        if stepped.succeeded:
            break
    dtypes = {REWARD: np.float32, DONE: bool, SUCCESS: bool}
    columns = {key: np.array(values, dtype=dtypes.get(key, np.float32)) for key, values in rows.items()}
    return Episode(core.task.SENTENCE or core.task.NAME, columns, bool(stepped is not None and stepped.succeeded), seed)


def expert_of(core: Core) -> Expert:
    """Raises DemonstrationError where the task has none."""
    name = core.task.NAME
    if name not in EXPERTS:
        raise DemonstrationError("there is no expert for %s; there are for %s" % (name, ", ".join(EXPERTS)))
    return EXPERTS[name](core)


def core_for(schema: Schema) -> Core:
    """The environment that a set was recorded in. Raises DemonstrationError where it was none."""
    about = schema.about
    if about.get("task") not in TASKS or "control" not in about:
        raise DemonstrationError("the set was not recorded in an environment of gym_baxter, but of %s"
                                 % (about.get("task") or "a task without a name"))
    return core_of(about["task"], about["control"], control_freq=schema.rate_hz,
                   robosuite_order=bool(about.get("robosuite_order")), **Conditions.of(about).choices)


def replay(core: Core, episode: Episode) -> dict[str, float]:
    """Do an episode's actions again from its start; returns {key: greatest difference} of what is observed, 0 where all
    is equal to the last bit. Raises DemonstrationError for an episode without a seed."""
    if episode.seed is None:
        raise DemonstrationError("the episode has no seed, so its start is not known")
    core.reset(np.random.default_rng(episode.seed))
    off: dict[str, float] = dict.fromkeys((STATE, ENVIRONMENT), 0.0)
    for row, action in enumerate(episode.columns[ACTION]):
        for key, value in ((STATE, core.agent_pos()), (ENVIRONMENT, core.task.observed())):
            difference = np.abs(value.astype(np.float32) - episode.columns[key][row])
            off[key] = max(off[key], float(difference.max(initial=0.0)))
        core.step(action)
    return off
