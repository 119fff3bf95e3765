# SPDX-License-Identifier: BSD-3-Clause
"""A policy and its file: one npz with the weights, and with the contract that says what it takes in and gives out."""
from __future__ import annotations

import dataclasses
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from demonstrations.layout import write_whole

from . import inputs
from .inputs import Inputs
from .network import Network

FORMAT = 1
#: How much less an older prediction of the same action counts than the next younger one: its factor.
ENSEMBLE = 0.7
#: Most of a normalised input.
MOST = 5.0


class PolicyError(Exception):
    """A file is no policy, or a policy does not fit; the text says what was found and what would be right."""


@dataclass(frozen=True)
class Contract:
    """What a policy needs and gives.

    task: of gym_baxter; control: kind of its actions; rate_hz: actions a second; observation, units: names of the
    observation's numbers, in order, and their units; action: names of an action's numbers; robosuite_order: whether the
    right arm is first; chunk: actions that it predicts at once; inputs: kind of the network's inputs; made: how it was
    trained, and with which versions.
    """

    task: str
    control: str
    rate_hz: int
    observation: tuple[str, ...]
    units: tuple[str, ...]
    action: tuple[str, ...]
    chunk: int
    robosuite_order: bool = False
    inputs: str = inputs.KIND
    made: dict[str, Any] = field(default_factory=dict)

    def require(self, **found: Any) -> None:
        """Compare with what is there: entries of this class by name. Raises PolicyError, which names the first that
        differs."""
        for name, value in found.items():
            wanted = getattr(self, name)
            if isinstance(wanted, tuple):
                _same_names(name, wanted, tuple(value))
            elif wanted != value:
                raise PolicyError("the policy needs %s %r; here it is %r" % (name, wanted, value))


def _same_names(name, wanted, found):
    for index, (one, other) in enumerate(zip(wanted, found, strict=False)):
        if one != other:
            raise PolicyError("number %d of the %s is %r for the policy; here it is %r" % (index, name, one, other))
    if len(wanted) != len(found):
        raise PolicyError("the policy needs %d numbers as %s; here are %d" % (len(wanted), name, len(found)))


def contract_of(text: Mapping[str, Any]) -> Contract:
    """A contract as JSON has it. Raises KeyError, TypeError."""
    return Contract(**{**text, **{name: tuple(text[name]) for name in ("observation", "units", "action")}})


def normalised(values: np.ndarray, mean: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(frames, inputs) float32 as the network sees them: far from everything that was shown is as far as MOST."""
    return np.clip((values - mean) / scale, -MOST, MOST).astype(np.float32)


@dataclass
class Policy:
    """contract; network; and for inputs and actions mean and scale, (n,) each: what the network says is
    (value - mean) / scale, and what it sees is `normalised`."""

    contract: Contract
    network: Network
    input_mean: np.ndarray
    input_scale: np.ndarray
    action_mean: np.ndarray
    action_scale: np.ndarray

    def __post_init__(self) -> None:
        contract = self.contract
        if contract.inputs != inputs.KIND:
            raise PolicyError("the policy's inputs are of kind %r; this version has %r"
                              % (contract.inputs, inputs.KIND))
        self.inputs = Inputs(contract.observation, contract.control != "osc_pose")
        expected = (len(self.inputs), contract.chunk * len(contract.action))
        found = (self.network.layers[0][0].shape[0], self.network.layers[-1][0].shape[1])
        if found != expected:
            raise PolicyError("the network goes from %d to %d numbers; its contract needs %d to %d"
                              % (*found, *expected))

    def chunks(self, observations: np.ndarray) -> np.ndarray:
        """(frames, chunk, action) of (frames, observation): the next actions, -1 to 1."""
        seen = normalised(self.inputs.of(observations), self.input_mean, self.input_scale)
        said = self.network(seen).reshape(len(observations), self.contract.chunk, -1)
        return np.clip(said * self.action_scale + self.action_mean, -1.0, 1.0)

    def save(self, path: Path) -> None:
        """Write the file, as a whole. Raises OSError."""
        arrays = {"input_mean": self.input_mean, "input_scale": self.input_scale, "action_mean": self.action_mean,
                  "action_scale": self.action_scale}
        for index, (weights, offsets) in enumerate(self.network.layers):
            arrays |= {"weights_%d" % index: weights, "offsets_%d" % index: offsets}
        contract = json.dumps({"format": FORMAT, **dataclasses.asdict(self.contract)})

        def write(draft):
            with open(draft, "wb") as file:
                np.savez(file, contract=np.array(contract), **arrays)

        write_whole(Path(path), write)


class Acting(Protocol):
    """What a `Runner` runs."""

    @property
    def contract(self) -> Contract:
        """What it takes in and gives out."""

    def chunks(self, observations: np.ndarray) -> np.ndarray:
        """(frames, chunk, action) of (frames, observation): the next actions, -1 to 1."""


def load(path: Path) -> Acting:
    """A policy from its file, npz or ONNX. Raises PolicyError."""
    if Path(path).suffix == ".onnx":
        from .onnx_reading import load as load_onnx

        return load_onnx(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise PolicyError("there is no policy file %s" % path) from None
    except (OSError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise PolicyError("%s is no policy file: %s" % (path, error)) from error
    try:
        text = json.loads(str(arrays["contract"]))
        if text.pop("format") != FORMAT:
            raise PolicyError("%s has another format than %d, which this version reads" % (path, FORMAT))
        contract = contract_of(text)
        layers = [(arrays["weights_%d" % index], arrays["offsets_%d" % index])
                  for index in range(sum(name.startswith("weights_") for name in arrays))]
        if not layers or not all(np.isfinite(array).all() for layer in layers for array in layer):
            raise PolicyError("%s has no weights, or weights that are not finite" % path)
        return Policy(contract, Network(layers),
                      *(arrays[name] for name in ("input_mean", "input_scale", "action_mean", "action_scale")))
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise PolicyError("%s is no policy file of this version: %s %s"
                          % (path, type(error).__name__, error)) from error


class Runner:
    """Does a policy action by action: each action is the mean of all that was predicted for it, the younger the more
    (temporal ensembling: Zhao et al., 2023, where older ones count more)."""

    def __init__(self, policy: Acting):
        self.policy = policy
        self.begin()

    def begin(self) -> None:
        """An episode begins."""
        self._chunks: list[np.ndarray] = []

    def act(self, observation: Sequence[float] | np.ndarray) -> np.ndarray:
        """(action,) of the present observation. Raises PolicyError for numbers that are not finite."""
        observation = np.asarray(observation, dtype=float)
        if observation.shape != (len(self.policy.contract.observation),) or not np.isfinite(observation).all():
            raise PolicyError("an observation is %d finite numbers; found %s"
                              % (len(self.policy.contract.observation), observation))
        self._chunks.insert(0, self.policy.chunks(observation[None])[0])
        del self._chunks[self.policy.contract.chunk:]
        predicted = np.array([chunk[age] for age, chunk in enumerate(self._chunks)])
        weights = ENSEMBLE ** np.arange(len(predicted))
        return weights @ predicted / weights.sum()
