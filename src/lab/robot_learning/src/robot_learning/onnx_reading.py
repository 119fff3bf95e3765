# SPDX-License-Identifier: BSD-3-Clause
"""A policy out of a file of ONNX, by onnxruntime: one that was written here, or one that was trained elsewhere."""
from __future__ import annotations

import dataclasses
import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np

from .onnx_writing import CONTRACT
from .policy import Contract, PolicyError, contract_of


class OnnxPolicy:
    """contract: what it takes in and gives out; session: of onnxruntime, with one input (frames, observation) and one
    output (frames, chunk, action), both float32."""

    def __init__(self, contract: Contract, session: Any):
        self.contract, self._session = contract, session
        self._input = session.get_inputs()[0].name

    def chunks(self, observations: np.ndarray) -> np.ndarray:
        """(frames, chunk, action) of (frames, observation): the next actions, -1 to 1. Raises PolicyError."""
        try:
            found = self._session.run(None, {self._input: np.asarray(observations, np.float32)})[0]
        except Exception as error:  # onnxruntime's errors have no base of their own
            raise PolicyError("onnxruntime cannot run the policy: %s" % error) from error
        wanted = (len(observations), self.contract.chunk, len(self.contract.action))
        if np.shape(found) != wanted:
            raise PolicyError("the policy says %s numbers; its contract needs %s" % (np.shape(found), wanted))
        return np.clip(found, -1.0, 1.0)


def load(path: Path) -> OnnxPolicy:
    """A policy from its file. Its contract is in the file, under the key `contract`, or beside it in a file of the same
    name with the suffix .json: the fields of `policy.Contract`. Raises PolicyError."""
    path = Path(path)
    if importlib.util.find_spec("onnxruntime") is None:
        raise PolicyError("%s needs onnxruntime, which is not installed: pip install onnxruntime" % path)
    import onnxruntime  # pyright: ignore[reportMissingImports]  (an extra)

    if not path.is_file():
        raise PolicyError("there is no policy file %s" % path)
    choices = onnxruntime.SessionOptions()
    choices.intra_op_num_threads = choices.inter_op_num_threads = 1
    try:
        session = onnxruntime.InferenceSession(str(path), choices, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no base of their own
        raise PolicyError("%s is no file of ONNX that can be read: %s" % (path, error)) from error
    beside = path.with_suffix(".json")
    said = session.get_modelmeta().custom_metadata_map.get(CONTRACT)
    try:
        if said is None:
            said = beside.read_text(encoding="utf-8")
        contract = contract_of(json.loads(said))
    except OSError:
        raise PolicyError("%s has no contract, and there is no %s with one: %s" % (
            path, beside, ", ".join(one.name for one in dataclasses.fields(Contract)))) from None
    except (KeyError, TypeError, ValueError) as error:
        raise PolicyError("the contract of %s is not as it must be: %s %s" % (
            path, type(error).__name__, error)) from error
    _require_shapes(path, contract, session)
    policy = OnnxPolicy(contract, session)
    try:
        policy.chunks(np.zeros((1, len(contract.observation))))
    except PolicyError as error:
        raise PolicyError("%s: %s" % (path, error)) from error
    return policy


def _require_shapes(path, contract, session):
    inputs, outputs = session.get_inputs(), session.get_outputs()
    expected = [len(contract.observation)], [contract.chunk, len(contract.action)]
    if len(inputs) != 1 or not outputs:
        raise PolicyError("%s has %d inputs; a policy of state has one" % (path, len(inputs)))
    found = tuple(list(one[0].shape[1:]) for one in (inputs, outputs))
    if found != expected:
        raise PolicyError("%s goes from frames of %s to %s; its contract needs %s to %s" % (path, *found, *expected))
