# SPDX-License-Identifier: BSD-3-Clause
"""How a program ends, also when its robot is disabled or stopped meanwhile."""
import errno
import signal
import types

import pytest

from baxter_interface import programs
from baxter_interface.programs import EnabledRobot, ProgramFailed, RobotLost


class Switch:
    """Replaces RobotEnable."""

    def __init__(self):
        self.enabled, self.stopped = False, False

    def state(self):
        return types.SimpleNamespace(enabled=self.enabled, stopped=self.stopped)

    def enable(self):
        self.enabled = True

    def disable(self):
        self.enabled = False


@pytest.fixture
def robot(monkeypatch):
    monkeypatch.setattr("baxter_interface.programs.RobotEnable", lambda versioned: Switch())
    return EnabledRobot()


@pytest.mark.parametrize("stopped, text", [(False, "it was disabled, or restarted"), (True, "it was stopped")])
@pytest.mark.parametrize("failure", [ProgramFailed("no move"), TimeoutError("the head did not turn")])
def test_what_fails_because_the_robot_was_lost_says_so(robot, stopped, text, failure):
    with pytest.raises(RobotLost, match=text) as caught, robot:
        robot.switch.enabled, robot.switch.stopped = False, stopped
        raise failure
    assert caught.value.__cause__ is failure


@pytest.mark.parametrize("failure", [ProgramFailed("no move"), ValueError("no number"), RobotLost("silent")])
def test_other_failures_stay_what_they_are(robot, failure):
    with pytest.raises(type(failure)) as caught, robot:
        raise failure
    assert caught.value is failure
    assert robot.switch.enabled == isinstance(failure, RobotLost)  # disabled as it was before, or left alone


def test_a_robot_that_was_disabled_before_is_disabled_again(robot):
    with robot:
        assert robot.is_enabled()
    assert not robot.is_enabled()


@pytest.fixture
def ending(monkeypatch):
    """Runs a program that ends with an error while it works; returns its exit code."""
    def run(error):
        def body():
            raise error
        return programs.run("tuck", body)

    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(programs.startup, "init_node", lambda *_, **__: None)
    monkeypatch.setattr(programs.rospy, "signal_shutdown", lambda reason: None)
    return run


def test_shutdown_during_a_wait_is_one_line(ending, capsys):
    assert ending(OSError(errno.ESHUTDOWN, "was waiting for a robot")) == 1
    said = capsys.readouterr().err
    assert said.endswith(": was waiting for a robot\n") and said.count("\n") == 1


def test_lost_reader_of_the_output_is_left_to_the_environment(ending):
    with pytest.raises(BrokenPipeError):
        ending(OSError(errno.EPIPE, "Broken pipe"))
