# SPDX-License-Identifier: BSD-3-Clause
"""What connect() refuses before it looks for anything."""
import pytest

import lab_session


def test_unknown_lab_is_answered_with_the_known_ones():
    with pytest.raises(lab_session.LabError, match="no lab 'nao'; there are: baxter, case_western, probot"):
        lab_session.connect("nao")


@pytest.mark.parametrize("uri", ["http://localhost", "http://localhost:ros"])
def test_master_without_a_port_is_named(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(lab_session.LabError, match="should look like http://localhost:11311"):
        lab_session.connect("baxter")


def test_no_master_is_said(monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    assert "No master answers at http://127.0.0.1:9" in repr(lab_session.Lab(["p", "f.launch"], "/topic"))
