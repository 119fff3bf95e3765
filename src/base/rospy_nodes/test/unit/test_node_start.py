# SPDX-License-Identifier: BSD-3-Clause
"""A node waits for what comes later, and ends when it is told to."""
import signal
import subprocess
import sys

import pytest
import rospy

from rospy_nodes import start


@pytest.fixture
def parameters(monkeypatch):
    """The parameters that are set; a value that is a list comes after as many questions as it is long."""
    values = {}

    def has(name):
        if isinstance(values.get(name), list) and values[name]:
            values[name].pop()
            return False
        return name in values

    monkeypatch.setattr(rospy, "has_param", has)
    monkeypatch.setattr(rospy, "get_param", values.get)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(rospy, "resolve_name", "/{}".format)
    monkeypatch.setattr(start, "_POLL_S", 0.0)
    return values


def test_a_parameter_that_comes_later_is_waited_for(parameters):
    parameters["robot"] = [None] * 3
    assert start.wait_for_param("robot", 60.0) == []


def test_one_that_never_comes_is_named(parameters):
    with pytest.raises(start.MissingParameter, match="parameter /robot is not set; load the robot first"):
        start.wait_for_param("robot", -1.0)


def test_a_node_that_is_ended_does_not_go_on_waiting(parameters, monkeypatch):
    monkeypatch.setattr(rospy, "is_shutdown", lambda: True)
    with pytest.raises(start.MissingParameter):
        start.wait_for_param("robot", 60.0)


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_a_signal_ends_a_node_that_holds_a_lock(number):
    program = """
import os, signal, threading, rospy
from rospy_nodes import start
lock, ended = threading.Lock(), threading.Event()

def shutdown(reason):
    with lock:
        print(reason, flush=True)
    ended.set()

rospy.signal_shutdown = shutdown
rospy.core.set_initialized(True)
start.end_on_signals()
with lock:
    os.kill(os.getpid(), signal.%s)
assert ended.wait(60.0)
""" % number
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout.startswith("signal ")) == (0, True), done.stderr


@pytest.mark.parametrize("number, code", [("SIGINT", -signal.SIGINT), ("SIGTERM", 128 + signal.SIGTERM)])
def test_a_signal_before_there_is_a_node_ends_the_program(number, code):
    program = ("import os, signal; from rospy_nodes.start import end_on_signals; end_on_signals(); "
               "os.kill(os.getpid(), signal.%s)")
    done = subprocess.run([sys.executable, "-c", program % number], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (code, "")
