# SPDX-License-Identifier: BSD-3-Clause
"""A master that takes connections and says nothing."""
import importlib.util
import socket

import pytest

from rospy_fixes import master_answers


def test_a_master_that_does_not_answer_is_an_error_of_the_caller(monkeypatch):
    monkeypatch.setattr(master_answers, "ANSWER_S", 0.2)
    spec = importlib.util.find_spec("rosgraph.masterapi")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)  # one of its own: the lab's environment has amended the other
    master_answers.amend(module)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        master = module.Master("/me", "http://127.0.0.1:%d" % silent.getsockname()[1])
        for question in (master.getSystemState, master.getTopicTypes, lambda: master.lookupNode("/other")):
            with pytest.raises(TimeoutError):
                question()
