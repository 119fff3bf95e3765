# SPDX-License-Identifier: BSD-3-Clause
"""A program's message when its robot is disabled or stopped meanwhile."""
import types

import pytest

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
