# SPDX-License-Identifier: BSD-3-Clause
"""A policy as a file of ONNX, with its contract in it: a graph from (frames, observation) to (frames, chunk, action).

Written without ONNX's library, by the published message numbers of onnx.proto (IR version 8, operators 13).
"""
from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np

from demonstrations.layout import write_whole

from .inputs import FINE_M
from .policy import MOST, Policy

#: The key of the contract in the file, and names of what goes in and comes out.
CONTRACT, OBSERVATION, ACTIONS = "contract", "observation", "actions"
_IR_VERSION, _OPERATORS = 8, 13
_FLOAT, _INT64 = 1, 7
_INT_ATTRIBUTE = 2
#: Of a quaternion x y z w: which products of two of its numbers there are, and the axes of its rotation as sums of
#: them, as `inputs` has them.
_PRODUCTS = list(combinations_with_replacement(range(4), 2))
_AXES = ({(1, 1): -2, (2, 2): -2}, {(0, 1): 2, (2, 3): 2}, {(0, 2): 2, (1, 3): -2},
         {(0, 1): 2, (2, 3): -2}, {(0, 0): -2, (2, 2): -2}, {(1, 2): 2, (0, 3): 2},
         {(0, 2): 2, (1, 3): 2}, {(1, 2): 2, (0, 3): -2}, {(0, 0): -2, (1, 1): -2})
_ONES = (1, 0, 0, 0, 1, 0, 0, 0, 1)
_TWO, _THREE = 6, 9


@dataclass
class OnnxGraph:
    """nodes: (operator, names of inputs, name of the output, whole attributes); tensors: constants by name."""

    nodes: list[tuple[str, tuple[str, ...], str, dict[str, int]]] = field(default_factory=list)
    tensors: dict[str, np.ndarray] = field(default_factory=dict)

    def add(self, operator: str, *inputs: str | np.ndarray, output: str = "", **attributes: int) -> str:
        """Append a node; arrays become constants. Returns the name of its output."""
        names = [one if isinstance(one, str) else self._constant(one) for one in inputs]
        output = output or "value_%d" % len(self.nodes)
        self.nodes.append((operator, tuple(names), output, attributes))
        return output

    def _constant(self, values):
        name = "constant_%d" % len(self.tensors)
        self.tensors[name] = values if values.dtype == np.int64 else np.asarray(values, np.float32)
        return name


def graph_of(policy: Policy) -> OnnxGraph:
    """The graph that computes `Policy.chunks`."""
    graph, taken, contract = OnnxGraph(), policy.inputs, policy.contract

    def columns(index: Sequence[int]) -> str:
        return graph.add("Gather", OBSERVATION, np.array(index, np.int64), axis=1)

    parts = [columns(group) for group in taken.places]
    parts += [_axes(graph, columns(group), _TWO) for group in taken.turns]
    if taken.others:
        parts.append(columns(taken.others))
    apart = [graph.add("Sub", columns(taken.places[second]), columns(taken.places[first]))
             for first, second in taken.pairs]
    parts += apart
    parts += [_fine(graph, one) for one in apart]
    for sight in taken.sights:
        hand, turn = _axes(graph, columns(sight.hand_turn), _THREE), _axes(graph, columns(sight.turn), _TWO)
        away = _seen(graph, hand, graph.add("Sub", columns(sight.place), columns(sight.hand_place)), range(3))
        parts += [_seen(graph, hand, turn, range(3)), _seen(graph, hand, turn, range(3, 6)), away, _fine(graph, away)]
    seen = graph.add("Concat", *parts, axis=1)
    seen = graph.add("Div", graph.add("Sub", seen, policy.input_mean), policy.input_scale)
    value = graph.add("Clip", seen, np.array(-MOST), np.array(MOST))
    for index, (weights, offsets) in enumerate(policy.network.layers):
        value = graph.add("Gemm", value, weights, offsets)
        if index + 1 < len(policy.network.layers):
            value = graph.add("Relu", value)
    value = graph.add("Reshape", value, np.array([-1, contract.chunk, len(contract.action)], np.int64))
    value = graph.add("Add", graph.add("Mul", value, policy.action_scale), policy.action_mean)
    graph.add("Clip", value, np.array(-1.0), np.array(1.0), output=ACTIONS)
    return graph


def _axes(graph, quaternion, count):
    first, second = (graph.add("Gather", quaternion, np.array(index, np.int64), axis=1)
                     for index in zip(*_PRODUCTS, strict=True))
    sums = np.array([[axis.get(pair, 0) for axis in _AXES[:count]] for pair in _PRODUCTS], float)
    return graph.add("Gemm", graph.add("Mul", first, second), sums, np.array(_ONES[:count], float))


def _seen(graph, axes, vectors, columns):
    """Three columns of vectors, along the axes of a frame."""
    thrice = graph.add("Gather", vectors, np.array([*columns] * 3, np.int64), axis=1)
    return graph.add("Gemm", graph.add("Mul", axes, thrice), np.repeat(np.eye(3), 3, axis=0), np.zeros(3))


def _fine(graph, difference):
    return graph.add("Tanh", graph.add("Mul", difference, np.array([1.0 / FINE_M])))


# -- messages: fields of a number, bytes, a text, or a message

def _varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])


def _message(*fields: tuple[int, Any]) -> bytes:
    found = b""
    for number, value in fields:
        if isinstance(value, int):
            found += _varint(number << 3) + _varint(value)
        else:
            content = value.encode() if isinstance(value, str) else value
            found += _varint(number << 3 | 2) + _varint(len(content)) + content
    return found


def _tensor(name: str, values: np.ndarray) -> bytes:
    kind = _INT64 if values.dtype == np.int64 else _FLOAT
    return _message(*((1, size) for size in values.shape), (2, kind), (8, name),
                    (9, values.astype("<i8" if kind == _INT64 else "<f4").tobytes()))


def _value(name: str, shape: Sequence[int]) -> bytes:
    """Of floats; the first axis is as long as there are frames."""
    sizes = [(1, _message((2, "frames"))), *((1, _message((1, size))) for size in shape)]
    return _message((1, name), (2, _message((1, _message((1, _FLOAT), (2, _message(*sizes)))))))


def _nodes(graph: OnnxGraph) -> Iterator[bytes]:
    for operator, inputs, output, attributes in graph.nodes:
        yield _message(*((1, name) for name in inputs), (2, output), (4, operator), *(
            (5, _message((1, name), (3, value), (20, _INT_ATTRIBUTE))) for name, value in attributes.items()))


def model_of(policy: Policy) -> bytes:
    """The content of the file."""
    graph, contract = graph_of(policy), policy.contract
    shape = (contract.chunk, len(contract.action))
    content = _message(
        *((1, node) for node in _nodes(graph)), (2, "policy"),
        *((5, _tensor(name, values)) for name, values in graph.tensors.items()),
        (11, _value(OBSERVATION, [len(contract.observation)])), (12, _value(ACTIONS, shape)))
    text = json.dumps(dataclasses.asdict(contract))
    return _message((1, _IR_VERSION), (2, "robot_learning"), (7, content), (8, _message((1, ""), (2, _OPERATORS))),
                    (14, _message((1, CONTRACT), (2, text))))


def save(policy: Policy, path: Path) -> None:
    """Write the file, as a whole. Raises OSError."""
    write_whole(Path(path), lambda draft: draft.write_bytes(model_of(policy)))
