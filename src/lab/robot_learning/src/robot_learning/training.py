# SPDX-License-Identifier: BSD-3-Clause
"""Behaviour cloning: a policy that does what demonstrations did, chunk of actions by chunk."""
from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from demonstrations.frames import ACTION, ENVIRONMENT, EXPERT_ACTION, STATE, DemonstrationError
from demonstrations.reading import DataSet
from demonstrations.watching import ON_THE_ROBOT

from .inputs import Inputs
from .network import Adam, Network
from .policy import Contract, Policy, normalised

#: Scales at least, of inputs and actions that hardly change.
_MIN_INPUT_SCALE, _MIN_ACTION_SCALE = 0.02, 1e-3
_SHOW_EVERY = 200


@dataclass(frozen=True)
class TrainingSettings:
    """chunk: actions predicted at once; hidden: sizes of layers; steps, batch: of Adam; rate: of learning at first, it
    falls to 0 as a cosine; decay: of weights; valid: share of the episodes that only judge; seed: of all chance."""

    chunk: int = 4
    hidden: tuple[int, ...] = (256, 256, 256)
    steps: int = 6000
    batch: int = 256
    rate: float = 1e-3
    decay: float = 0.3
    valid: float = 0.1
    seed: int = 0


@dataclass
class LossCurve:
    """Losses on the way: after `steps`, of the training's batches and of the episodes that only judge; `seconds`: of
    the whole training."""

    steps: list[int] = field(default_factory=list)
    training: list[float] = field(default_factory=list)
    validation: list[float] = field(default_factory=list)
    seconds: float = 0.0


@dataclass
class Examples:
    """observations (frames, n), chunks (frames, chunk, action); there (frames, chunk): whether it is before the end."""

    observations: np.ndarray
    chunks: np.ndarray
    there: np.ndarray

    @classmethod
    def of(cls, data: DataSet, numbers: list[int], chunk: int) -> Examples:
        """Of some episodes of a set; the expert's own actions where it has them."""
        parts = []
        for number in numbers:
            data.check_numbers(number)
            columns = data.episode(number).columns
            actions = columns.get(EXPERT_ACTION, columns[ACTION])
            index = np.arange(len(actions))[:, None] + np.arange(chunk)
            seen = np.concatenate([columns[STATE], columns[ENVIRONMENT]], axis=1)
            parts.append((seen, actions[np.minimum(index, len(actions) - 1)], index < len(actions)))
        return cls(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def contract_of(data: DataSet, chunk: int, made: dict[str, Any] | None = None) -> Contract:
    """The contract of a policy that learns from a set. Raises DemonstrationError where the set lacks something."""
    schema = data.schema
    if schema.about.get("task") == ON_THE_ROBOT:
        raise DemonstrationError("%s was recorded on the robot, not in an environment of gym_baxter, where what is "
                                 "learned could be measured; lerobot-train takes such sets" % data.folder)
    for key in (STATE, ENVIRONMENT, ACTION):
        if key not in schema.features or schema.features[key].names is None:
            raise DemonstrationError("%s has no feature %s with names" % (data.folder, key))
    for key in ("task", "control"):
        if not isinstance(schema.about.get(key), str):
            raise DemonstrationError("%s says as its %s %r; it was not recorded in an environment of gym_baxter"
                                     % (data.folder, key, schema.about.get(key)))
    seen = [schema.features[key] for key in (STATE, ENVIRONMENT)]
    names = [name for feature in seen for name in feature.names or ()]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise DemonstrationError("%s has the names %s more than once in %s and %s" % (
            data.folder, ", ".join(repeated), STATE, ENVIRONMENT))
    return Contract(
        schema.about["task"], schema.about["control"], schema.rate_hz,
        tuple(names),
        tuple(unit for feature in seen for unit in feature.units or ("",) * feature.shape[0]),
        schema.features[ACTION].names or (), chunk, bool(schema.about.get("robosuite_order")), made=made or {})


def train(data: DataSet, settings: TrainingSettings = TrainingSettings(), made: dict[str, Any] | None = None,  # noqa: B008 (frozen)
          progress: Callable[[int, float, float], None] = lambda step, training, validation: None,
          chosen: Iterable[int] | None = None) -> tuple[Policy, LossCurve]:
    """Learn from all successful episodes of a set, or from those that are `chosen`, too. progress: called now and then
    with the step and both losses. The same set and settings give the same policy on one machine. Raises
    DemonstrationError."""
    random = np.random.default_rng(settings.seed)
    numbers = [number for number in (range(len(data)) if chosen is None else chosen) if data.episode(number).success]
    if not numbers:
        raise DemonstrationError("%s has no successful episode to learn from" % data.folder)
    random.shuffle(numbers)
    judged = round(settings.valid * len(numbers))
    contract = contract_of(data, settings.chunk, made)
    examples = Examples.of(data, numbers[judged:], settings.chunk)
    judge = Examples.of(data, numbers[:judged], settings.chunk) if judged else examples
    taken = Inputs(contract.observation, contract.control != "osc_pose", contract.inputs)
    seen = taken.of(examples.observations)
    mean, scale = seen.mean(axis=0), np.maximum(seen.std(axis=0), _MIN_INPUT_SCALE)
    actions = examples.chunks[:, 0]
    action_mean, action_scale = actions.mean(axis=0), actions.std(axis=0)
    action_scale = np.where(action_scale < _MIN_ACTION_SCALE, 1.0, action_scale)

    def prepared(some, inputs):
        wanted = ((some.chunks - action_mean) / action_scale).reshape(len(some.chunks), -1).astype(np.float32)
        share = np.repeat(some.there, len(contract.action), axis=1).astype(np.float32)
        return normalised(inputs, mean, scale), wanted, share

    inputs, wanted, share = prepared(examples, seen)
    valid = prepared(judge, taken.of(judge.observations))
    network = Network.random((len(taken), *settings.hidden, wanted.shape[1]), random)
    adam, curve, began, recent = Adam(network, settings.decay), LossCurve(), time.monotonic(), []
    for step in range(settings.steps):
        batch = random.integers(len(inputs), size=min(settings.batch, len(inputs)))
        loss, gradients = network.gradients(inputs[batch], wanted[batch], share[batch])
        adam.step(gradients, settings.rate * 0.5 * (1.0 + np.cos(np.pi * step / settings.steps)))
        recent.append(loss)
        if (step + 1) % _SHOW_EVERY == 0 or step + 1 == settings.steps:
            curve.steps.append(step + 1)
            curve.training.append(float(np.mean(recent)))
            curve.validation.append(float(np.mean(valid[2] * (network(valid[0]) - valid[1]) ** 2)))
            recent.clear()
            progress(step + 1, curve.training[-1], curve.validation[-1])
    curve.seconds = time.monotonic() - began
    policy = Policy(contract, network, mean, scale, action_mean, action_scale)
    return policy, curve
