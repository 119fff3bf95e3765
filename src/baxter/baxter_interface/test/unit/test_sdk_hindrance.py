# SPDX-License-Identifier: BSD-3-Clause
"""Reasons why a robot does not do what a program asks, without ROS connections."""
from baxter_interface.hindrance import IgnoredCommands

WHY = "the robot is not enabled"


def test_a_command_to_a_robot_that_takes_none_is_told_once():
    ignored = IgnoredCommands()
    assert ignored.heard(0.0, WHY) == "", "nothing was asked"
    ignored.sent(1.0)
    assert [ignored.heard(1.0 + 0.1 * i, WHY) for i in range(6)] == ["", "", "", WHY, "", ""]
    ignored.sent(2.0)
    assert ignored.heard(2.5, WHY) == WHY


def test_late_news_of_enabling_and_disabling_after_a_command_are_no_refusal():
    ignored = IgnoredCommands()
    ignored.heard(0.0, WHY)
    ignored.sent(0.1)
    assert ignored.heard(0.2, "") == ignored.heard(0.5, WHY) == "", "it was enabled when the command came"
    ignored.heard(1.0, "")
    ignored.sent(1.1)
    assert ignored.heard(9.0, WHY) == "", "it was disabled after the command"
