# SPDX-License-Identifier: BSD-3-Clause
"""How connect() handles its arguments, before it searches for a lab."""
import contextlib

import pytest

import lab_session
from lab_session import session


def test_unknown_lab_is_answered_with_the_known_ones():
    with pytest.raises(lab_session.NoLab, match="no lab 'nao'; there are: baxter, case_western, probot"):
        lab_session.connect("nao")


@pytest.mark.parametrize("uri", ["http://localhost", "http://localhost:ros"])
def test_master_without_a_port_is_named(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(lab_session.NoLab, match="should look like http://localhost:11311"):
        lab_session.connect("baxter")


def test_no_master_is_said(monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    assert "No master answers at http://127.0.0.1:9" in repr(lab_session.RunningLab(["p", "f.launch"], "/topic"))


@pytest.fixture
def asked(monkeypatch):
    """The commands of requested simulators; the first one does not start."""
    commands = []

    def find_or_start(lab):
        commands.append(lab._command)
        if len(commands) == 1:
            raise lab_session.NoLab("roslaunch has ended")

    monkeypatch.setattr(session, "_labs", {})
    monkeypatch.setattr(session, "_only_one", contextlib.nullcontext)
    monkeypatch.setattr(session, "_find_or_start", find_or_start)
    monkeypatch.setattr(session, "_become_node", lambda name: None)
    monkeypatch.setattr(session.startup, "wait_for_start", lambda conditions, timeout_s: None)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    return commands


def test_a_start_that_failed_is_not_what_the_next_call_gets(asked):
    with pytest.raises(lab_session.NoLab, match="has ended"):
        lab_session.connect("baxter", "gui=false")
    lab_session.connect("baxter", "gui:=false")
    lab_session.connect("baxter")
    assert [command[2:] for command in asked] == [["gui=false"], ["gui:=false"], []]


def test_what_runs_goes_on_and_other_arguments_are_told_how_they_come_to_count(asked, monkeypatch, capsys):
    with pytest.raises(lab_session.NoLab):
        lab_session.connect("baxter", "gui:=false")
    monkeypatch.setattr(session.RunningLab, "is_ours", True)
    lab_session.connect("baxter", "gui:=false")
    assert "lab.stop() stops it, and" not in capsys.readouterr().err
    lab_session.connect("baxter", "gui:=true")
    assert asked[-1][2:] == ["gui:=false"]
    assert "gui:=false; lab.stop() stops it, and the next connect starts it again" in capsys.readouterr().err
