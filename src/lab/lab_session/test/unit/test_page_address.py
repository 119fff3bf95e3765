# SPDX-License-Identifier: BSD-3-Clause
"""The address of the lab's page in a notebook: found, or its server started."""
from types import SimpleNamespace

import pytest

from lab_session import NoLab, session

ADDRESS = "http://localhost:8090/?token=drive"


@pytest.fixture
def lab(monkeypatch, tmp_path):
    made = session.RunningLab(["roslaunch"], "/topic")
    made.started = []

    def run(*command):
        made.started.append(command)
        made._programs[command] = SimpleNamespace(poll=lambda: made.ended)
        log = tmp_path / "page.log"
        log.write_text("lab_web: no lab runs\n")
        return log
    made.ended = None
    monkeypatch.setattr(made, "run", run)
    return made


def test_a_page_that_runs_is_found(lab, monkeypatch):
    monkeypatch.setattr(session.page_files, "address", lambda _uri: ADDRESS)
    assert lab.page() == ADDRESS and lab.started == []


def test_without_a_page_its_server_is_started(lab, monkeypatch):
    monkeypatch.setattr(session.page_files, "address", lambda _uri: ADDRESS if lab.started else None)
    assert lab.page() == ADDRESS and lab.started == [("rosrun", "lab_web", "lab_web")]


def test_a_server_that_ends_at_once_is_an_error_with_its_last_lines(lab, monkeypatch):
    monkeypatch.setattr(session.page_files, "address", lambda _uri: None)
    lab.ended = 2
    with pytest.raises(NoLab, match="no lab runs"):
        lab.page()
