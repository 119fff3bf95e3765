# SPDX-License-Identifier: BSD-3-Clause
"""The command ends with one line where it cannot fit, and refuses names that serial:=FILE would not take for files."""
import importlib.util
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "sysid"


@pytest.fixture(scope="module")
def command():
    loader = SourceFileLoader("sysid", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("sysid", loader))
    loader.exec_module(module)
    return module


def test_a_recording_that_is_missing_or_is_none(command, tmp_path, capsys):
    assert command.main([str(tmp_path / "none.csv")]) == 2
    assert "none.csv cannot be read" in capsys.readouterr().err
    empty = tmp_path / "empty.csv"
    empty.write_text("time_s,what\n0,1\n1,2\n")
    assert command.main([str(empty)]) == 2
    assert "seven joints" in capsys.readouterr().err


def test_the_output_s_name_must_be_one_that_a_serial_can_be(command, capsys):
    with pytest.raises(SystemExit) as caught:
        command.main(["x.csv", "--out", "own.txt"])
    assert caught.value.code == 2 and "own.txt" in capsys.readouterr().err
