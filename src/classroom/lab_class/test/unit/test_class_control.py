# SPDX-License-Identifier: BSD-3-Clause
"""Calls of the commands to the supervisor that go wrong."""
import contextlib
import socket

import pytest

from lab_class import control
from lab_class.labs import ClassError
from lab_class.store import Store


@pytest.fixture
def store(tmp_path):
    made = Store(tmp_path / "class")
    made.make()
    made.write_running({"control": str(tmp_path / "control")})
    return made


def test_a_late_answer_is_not_taken_for_the_end_of_the_class(store, tmp_path, monkeypatch):
    monkeypatch.setattr(control, "_TIMEOUT_S", 0.1)
    with contextlib.closing(socket.socket(socket.AF_UNIX)) as listener:
        listener.bind(str(tmp_path / "control"))
        listener.listen()
        with pytest.raises(ClassError, match="did not answer within 0.1 s") as raised:
            control.call(store, "GET", "/labs")
    assert not isinstance(raised.value, control.NoClass)


def test_a_supervisor_that_has_gone(store):
    with pytest.raises(control.NoClass, match="no class runs in .* any more"):
        control.call(store, "GET", "/labs")
