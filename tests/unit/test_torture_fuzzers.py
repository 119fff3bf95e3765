# SPDX-License-Identifier: BSD-3-Clause
"""A slice of the fuzzers that need no lab; `./baxter.sh test torture` runs 100,000 inputs of each."""
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).resolve().parents[1] / "torture" / "torture.py"


@pytest.mark.parametrize("suite, inputs", [("handshakes", 500), ("names", 1000), ("submissions", 500)])
def test_a_slice_finds_nothing(suite, inputs, tmp_path):
    done = subprocess.run([sys.executable, str(PROGRAM), suite, "--seed", "16", "--messages", str(inputs), "--out",
                           str(tmp_path)], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "none in %d messages" % inputs in done.stdout
