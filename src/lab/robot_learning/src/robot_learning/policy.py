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
    """The inputs and outputs of a policy.

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
    """A contract as JSON has it. Raises KeyError, TypeError, and ValueError for what cannot be."""
    found = Contract(**{**text, **{name: _texts(name, text[name]) for name in ("observation", "units", "action")}})
    for name in ("task", "control", "inputs"):
        if not isinstance(getattr(found, name), str):
            raise ValueError("%s is %r; it must be a text" % (name, getattr(found, name)))
    for name in ("rate_hz", "chunk"):
        value = getattr(found, name)
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise ValueError("%s is %r; it must be a whole number from 1" % (name, value))
    if len(found.units) != len(found.observation):
        raise ValueError("there are %d units for %d numbers of the observation"
                         % (len(found.units), len(found.observation)))
    if not isinstance(found.robosuite_order, bool):
        raise ValueError("robosuite_order is %r; it must be true or false" % (found.robosuite_order,))
    return found


def _texts(name, texts):
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise ValueError("%s is %r; it must be a list of texts" % (name, texts))
    return tuple(texts)


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
        if contract.inputs not in inputs.KINDS:
            raise PolicyError("the policy's inputs are of kind %r; this version has %s"
                              % (contract.inputs, ", ".join(map(repr, inputs.KINDS))))
        self.inputs = Inputs(contract.observation, contract.control != "osc_pose", contract.inputs)
        self._require_numbers()
        expected = (len(self.inputs), contract.chunk * len(contract.action))
        found = (self.network.layers[0][0].shape[0], self.network.layers[-1][0].shape[1])
        if found != expected:
            raise PolicyError("the network goes from %d to %d numbers; its contract needs %d to %d"
                              % (*found, *expected))

    def _require_numbers(self):
        """Raises PolicyError where an action would be no number, or an array does not fit the others."""
        width = self.network.layers[0][0].shape[0]
        for index, (weights, offsets) in enumerate(self.network.layers):
            if weights.ndim != 2 or offsets.shape != weights.shape[1:] or width != weights.shape[0]:
                raise PolicyError("layer %d has weights %s and offsets %s after %d numbers; they do not fit"
                                  % (index, weights.shape, offsets.shape, width))
            if not (np.isfinite(weights).all() and np.isfinite(offsets).all()):
                raise PolicyError("layer %d has weights that are not finite" % index)
            width = weights.shape[1]
        for name, size in (("input", len(self.inputs)), ("action", len(self.contract.action))):
            for what in ("mean", "scale"):
                values = np.asarray(getattr(self, "%s_%s" % (name, what)))
                wanted = "%d finite numbers%s" % (size, " above 0" if what == "scale" else "")
                if values.shape != (size,) or values.dtype.kind != "f":
                    raise PolicyError("%s_%s has %s %s; it must have %s" % (
                        name, what, values.dtype, values.shape, wanted))
                bad = ~np.isfinite(values) | ((what == "scale") & (values <= 0.0))
                if bad.any():
                    raise PolicyError("%s_%s has %g at place %d; it must have %s" % (
                        name, what, values[bad][0], np.flatnonzero(bad)[0], wanted))

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
    """A policy as a `Runner` runs it."""

    @property
    def contract(self) -> Contract:
        """Its inputs and outputs."""
        ...

    def chunks(self, observations: np.ndarray) -> np.ndarray:
        """(frames, chunk, action) of (frames, observation): the next actions, -1 to 1."""
        ...


def load(path: Path) -> Acting:
    """A policy from its file, npz or ONNX. Raises PolicyError."""
    if Path(path).suffix.lower() == ".onnx":
        from .onnx_reading import load as load_onnx

        return load_onnx(path)
    if Path(path).is_file() and not zipfile.is_zipfile(path):
        raise PolicyError("%s is no policy file: it is no npz, nor is it named .onnx" % path)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise PolicyError("there is no policy file %s" % path) from None
    except (OSError, ValueError, TypeError, AttributeError, zipfile.BadZipFile, EOFError) as error:
        raise PolicyError("%s is no policy file: %s" % (path, error)) from error
    try:
        text = json.loads(str(arrays["contract"]))
        if text.pop("format") != FORMAT:
            raise PolicyError("it has another format than %d, which this version reads" % FORMAT)
        contract = contract_of(text)
        layers = [(arrays["weights_%d" % index], arrays["offsets_%d" % index])
                  for index in range(sum(name.startswith("weights_") for name in arrays))]
        if not layers:
            raise PolicyError("it has no weights")
        return Policy(contract, Network(layers),
                      *(arrays[name] for name in ("input_mean", "input_scale", "action_mean", "action_scale")))
    except PolicyError as error:
        raise PolicyError("%s: %s" % (path, error)) from None
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
        """(action,) of the present observation. Raises PolicyError for numbers that are not finite, seen or said."""
        observation = np.asarray(observation, dtype=float)
        if observation.shape != (len(self.policy.contract.observation),) or not np.isfinite(observation).all():
            raise PolicyError("an observation is %d finite numbers; found %s"
                              % (len(self.policy.contract.observation), observation))
        said = self.policy.chunks(observation[None])[0]
        if not np.isfinite(said).all():
            raise PolicyError("the policy says actions that are not finite")
        self._chunks.insert(0, said)
        del self._chunks[self.policy.contract.chunk:]
        predicted = np.array([chunk[age] for age, chunk in enumerate(self._chunks)])
        weights = ENSEMBLE ** np.arange(len(predicted))
        return weights @ predicted / weights.sum()
