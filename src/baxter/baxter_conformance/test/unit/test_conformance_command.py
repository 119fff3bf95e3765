# SPDX-License-Identifier: BSD-3-Clause
"""The command says in one line why it compared nothing, and ends with status 2."""
import importlib.util
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest
import rosgraph
import rospy

from baxter_conformance.comparison import SeenInterface

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "conformance"


@pytest.fixture
def conformance(monkeypatch):
    """main(*words) on a master that is there, with a robot that has nothing."""
    loader = SourceFileLoader("conformance", str(SCRIPT))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("conformance", loader))
    loader.exec_module(module)
    monkeypatch.setattr(rosgraph, "is_master_online", lambda: True)
    monkeypatch.setattr(rospy, "init_node", lambda *_, **__: None)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(module, "read", lambda robot, timeout_s: SeenInterface())

    def main(*words):
        monkeypatch.setattr(sys, "argv", ["conformance", *words])
        return module.main()
    main.module = module
    return main


def test_a_robot_without_anything_is_compared(conformance, capsys):
    assert conformance() == 1
    assert "0 of 2" in capsys.readouterr().out


@pytest.mark.parametrize("error", [ConnectionRefusedError("refused"), rosgraph.MasterException("gone"),
                                   rospy.ROSException("unable to register")])
def test_a_master_that_ends_is_no_finding(conformance, monkeypatch, capsys, error):
    def read(robot, timeout_s):
        raise error
    monkeypatch.setattr(conformance.module, "read", read)
    assert conformance() == 2
    said = capsys.readouterr()
    assert said.out == "" and "stopped answering" in said.err and str(error) in said.err


def test_a_master_that_is_gone_after_the_reading_is_no_finding(conformance, monkeypatch, capsys):
    answers = iter((True, False))
    monkeypatch.setattr(rosgraph, "is_master_online", lambda: next(answers))
    assert conformance() == 2
    assert "nothing was compared" in capsys.readouterr().err


def test_a_file_that_cannot_be_written(conformance, tmp_path, capsys):
    assert conformance("--json", str(tmp_path / "missing" / "findings.json")) == 2
    assert "cannot be written" in capsys.readouterr().err


@pytest.mark.parametrize("timeout", ["-1", "0", "nan", "inf", "long"])
def test_a_timeout_is_a_positive_number(conformance, timeout, capsys):
    with pytest.raises(SystemExit) as caught:
        conformance("--timeout", timeout)
    assert caught.value.code == 2 and "not %s" % timeout in capsys.readouterr().err
