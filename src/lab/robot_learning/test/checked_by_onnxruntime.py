# SPDX-License-Identifier: BSD-3-Clause
"""onnxruntime computes what a policy does: `checked_by_onnxruntime.py POLICY.npz`. For a Python with onnxruntime, onnx,
and this workspace's library."""
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import onnx

from robot_learning import onnx_writing
from robot_learning.policy import PolicyError, load


def refused(path, text):
    try:
        load(path)
    except PolicyError as error:
        assert text in str(error), error
    else:
        raise AssertionError("%s is read" % path)


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
    print("contracts and broken files are told")


if __name__ == "__main__":
    main()
