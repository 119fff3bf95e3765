# SPDX-License-Identifier: BSD-3-Clause
"""A file of ONNX computes what its policy does, and has its contract. `../checked_by_onnxruntime.py` reads one by
onnxruntime itself."""
import importlib.util
import json

import numpy as np
import pytest

from robot_learning import onnx_writing
from robot_learning.inputs import KINDS, Inputs
from robot_learning.network import Network
from robot_learning.policy import Contract, Policy, PolicyError, load

NAMES = ("left_hand.x", "left_hand.y", "left_hand.z", "left_hand.qx", "left_hand.qy", "left_hand.qz", "left_hand.qw",
         "left_gripper.open", "left_s0.vel", "block.x", "block.y", "block.z", "block.qx", "block.qy", "block.qz",
         "block.qw", "goal.x", "goal.y", "goal.z", "block_from_left_hand.x")
#: What each operator does, as ONNX's documentation says.
OPERATORS = {
    "Gather": lambda data, index, axis: np.take(data, index, axis), "Concat": lambda *parts, axis: np.concatenate(
        parts, axis), "Sub": np.subtract, "Add": np.add, "Mul": np.multiply, "Div": np.divide, "Tanh": np.tanh,
    "Clip": np.clip, "Gemm": lambda a, b, c: a @ b + c, "Relu": lambda value: np.maximum(value, 0.0),
    "Reshape": lambda value, shape: value.reshape(shape)}


@pytest.fixture(scope="module", params=KINDS)
def policy(request):
    random = np.random.default_rng(3)
    contract = Contract("PickPlace", "osc_pose", 20, NAMES, ("",) * len(NAMES), ("a", "b", "c"), 4,
                        inputs=request.param)
    width = len(Inputs(NAMES, False, request.param))
    mean, scale = random.normal(size=width), random.uniform(0.2, 1.0, width)
    return Policy(contract, Network.random((width, 16, 12), random), mean, scale, random.normal(0.0, 0.2, 3),
                  random.uniform(0.5, 2.0, 3))


def seen(count=7):
    found = np.random.default_rng(4).normal(0.0, 0.5, (count, len(NAMES)))
    for first in (3, 12):
        found[:, first:first + 4] /= np.linalg.norm(found[:, first:first + 4], axis=1, keepdims=True)
    return found


def test_the_graph_computes_what_the_policy_does(policy):
    graph = onnx_writing.graph_of(policy)
    values = {**graph.tensors, onnx_writing.OBSERVATION: seen().astype(np.float32)}
    for operator, inputs, output, attributes in graph.nodes:
        first, *others = (values[name].dtype for name in inputs)
        assert first == np.float32
        assert set(others) <= {np.dtype(np.int64 if operator in ("Gather", "Reshape") else np.float32)}
        values[output] = OPERATORS[operator](*(values[name] for name in inputs), **attributes)
    assert len(np.unique(values[onnx_writing.ACTIONS])) > 50
    np.testing.assert_allclose(values[onnx_writing.ACTIONS], policy.chunks(seen()), atol=1e-5)


def fields(content):
    """[(number, value)] of a message: integers and bytes."""
    found, at = [], 0

    def varint():
        nonlocal at
        value = shift = 0
        while True:
            byte = content[at]
            at, value, shift = at + 1, value | (byte & 0x7F) << shift, shift + 7
            if byte < 0x80:
                return value

    while at < len(content):
        key = varint()
        if key & 7 == 0:
            found.append((key >> 3, varint()))
        else:
            assert key & 7 == 2
            length = varint()
            found.append((key >> 3, content[at:at + length]))
            at += length
    assert at == len(content)
    return found


def test_the_file_has_the_graph_and_the_contract(policy, tmp_path):
    onnx_writing.save(policy, tmp_path / "policy.onnx")
    model = fields((tmp_path / "policy.onnx").read_bytes())
    assert dict(model)[1] == 8 and dict(fields(dict(model)[8]))[2] == 13
    about = dict(fields(dict(model)[14]))
    assert about[1] == b"contract" and json.loads(about[2])["observation"] == list(NAMES)
    graph, wanted = fields(dict(model)[7]), onnx_writing.graph_of(policy)
    assert [dict(fields(node))[4].decode() for number, node in graph if number == 1] == [one[0] for one in wanted.nodes]
    for (number, content), (name, values) in zip((one for one in graph if one[0] == 5), wanted.tensors.items(),
                                                 strict=True):
        tensor = fields(content)
        kind = {1: "<f4", 7: "<i8"}[dict(tensor)[2]]
        shape = [size for one, size in tensor if one == 1]
        found = np.frombuffer(dict(tensor)[9], kind).reshape(shape)
        assert number == 5 and dict(tensor)[8].decode() == name
        np.testing.assert_array_equal(found, values)


@pytest.mark.skipif(importlib.util.find_spec("onnxruntime") is not None, reason="onnxruntime is installed")
def test_without_onnxruntime_an_error_says_how_to_install_it(tmp_path):
    with pytest.raises(PolicyError, match="pip install onnxruntime"):
        load(tmp_path / "policy.onnx")
