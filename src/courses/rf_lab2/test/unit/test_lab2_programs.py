# SPDX-License-Identifier: BSD-3-Clause
"""How the lab's programs end."""
import errno

import pytest
import rospy

from rf_lab2 import programs


def raising(error):
    def body():
        raise error
    return body


@pytest.fixture(autouse=True)
def without_a_robot(monkeypatch):
    monkeypatch.setattr(programs.startup, "init_node", lambda name: None)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), rospy.ROSInterruptException("ROS shutdown request"),
                                   OSError(errno.ESHUTDOWN, "ROS is shutting down; was waiting for a robot")])
def test_ctrl_c_ends_a_program_without_a_word(error, capsys):
    assert programs.run("wave", raising(error)) == 130
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("kind", [programs.LabProgramFailed, ValueError, rospy.ROSException])
def test_a_failure_is_one_line(kind, capsys):
    assert programs.run("wave", raising(kind("no arm"))) == 1
    said = capsys.readouterr().err
    assert said.endswith(": no arm\n") and said.count("\n") == 1
