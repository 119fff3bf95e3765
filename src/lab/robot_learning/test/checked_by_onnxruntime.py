# SPDX-License-Identifier: BSD-3-Clause
"""onnxruntime computes what a policy does: `checked_by_onnxruntime.py POLICY.npz`. For a Python with onnxruntime, onnx,
and this workspace's library."""
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from robot_learning import onnx_writing
from robot_learning.policy import PolicyError, Runner, load


def refused(path, text):
    try:
        load(path)
    except PolicyError as error:
        assert text in str(error), error
    else:
        raise AssertionError("%s is read" % path)


def foreign(path, contract, weight=0.0, kind=TensorProto.FLOAT, frames="frames", said="frames"):
    """Write a policy as other programs would: what is seen times a matrix of ``weight``, as actions."""
    seen, chunk, actions = len(contract["observation"]), contract["chunk"], len(contract["action"])
    numbers = np.full((seen, chunk * actions), weight, helper.tensor_dtype_to_np_dtype(kind))
    shape = np.array([-1, chunk, actions], np.int64)
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["seen", "numbers"], ["flat"]),
         helper.make_node("Reshape", ["flat", "shape"], ["actions"])], "foreign",
        [helper.make_tensor_value_info("seen", kind, [frames, seen])],
        [helper.make_tensor_value_info("actions", kind, [said, chunk, actions])],
        [numpy_helper.from_array(numbers, "numbers"), numpy_helper.from_array(shape, "shape")])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.save(model, path)
    path.with_suffix(".json").write_text(json.dumps(contract), encoding="utf-8")


def foreign_files_are_read_or_refused(contract, scratch):
    path = scratch / "foreign.onnx"
    foreign(path, contract)
    assert not load(path).chunks(np.ones((3, len(contract["observation"])))).any()
    foreign(path, contract, kind=TensorProto.DOUBLE)
    refused(path, "onnxruntime cannot run the policy")
    foreign(path, contract, frames=2, said=2)
    refused(path, "onnxruntime cannot run the policy")
    foreign(path, contract, weight=np.nan)
    runner = Runner(load(path))
    try:
        runner.act(np.ones(len(contract["observation"])))
    except PolicyError as error:
        assert "not finite" in str(error), error
    else:
        raise AssertionError("NaN is an action")


def main():
    ours, scratch = load(Path(sys.argv[1])), Path(tempfile.mkdtemp())
    path = scratch / "policy.onnx"
    onnx_writing.save(ours, path)
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    theirs = load(path)
    assert theirs.contract == ours.contract
    seen = np.random.default_rng(0).normal(0.3, 0.3, (1000, len(ours.contract.observation)))
    off = np.abs(theirs.chunks(seen) - ours.chunks(seen)).max()
    assert off < 1e-4, off
    print("1000 observations: greatest difference of an action %.1e" % off)
    contract = json.loads(model.metadata_props[0].value)
    del model.metadata_props[:]
    bare = scratch / "bare.onnx"
    onnx.save(model, bare)
    refused(bare, "no contract")
    bare.with_suffix(".json").write_text(json.dumps(contract), encoding="utf-8")
    np.testing.assert_array_equal(load(bare).chunks(seen), theirs.chunks(seen))
    bare.with_suffix(".json").write_text(json.dumps({**contract, "chunk": 3}), encoding="utf-8")
    refused(bare, "its contract needs")
    (scratch / "broken.onnx").write_bytes(path.read_bytes()[:500])
    refused(scratch / "broken.onnx", "no file of ONNX")
    foreign_files_are_read_or_refused(contract, scratch)
    print("contracts, broken files, and what cannot be run are told")


if __name__ == "__main__":
    main()
