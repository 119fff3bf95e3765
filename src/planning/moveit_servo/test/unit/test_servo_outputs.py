# SPDX-License-Identifier: BSD-3-Clause
"""Set-points as the messages of controllers."""
import numpy as np
import pytest
from baxter_core_msgs.msg import JointCommand

from moveit_servo.outputs import message_of, message_type
from moveit_servo.servo import Status, Step
from moveit_servo.settings import ARRAY, BAXTER, TRAJECTORY, ServoSettings, SettingsError

JOINTS = ("a", "b")
STEP = Step(np.array((0.1, 0.2)), np.array((0.5, -0.5)), np.zeros(2), Status.NO_WARNING, "", False, False)
MEASURED = np.array((0.1, 0.1))


def sent(**settings):
    return message_of(STEP, MEASURED, JOINTS, ServoSettings(**settings))


def test_a_trajectory_begins_at_once_with_the_next_set_point():
    message = sent(command_out_type=TRAJECTORY)
    point, = message.points
    assert message.header.stamp.is_zero() and message.joint_names == ["a", "b"]
    assert point.positions == [0.1, 0.2] and not point.velocities and point.time_from_start.to_sec() == 0.008


@pytest.mark.parametrize(("seconds", "expected"), [(0.002, 0.008), (0.03, 0.03)])
def test_the_way_of_a_long_step_takes_its_time(seconds, expected):
    settings = ServoSettings(command_out_type=TRAJECTORY)
    point, = message_of(STEP, MEASURED, JOINTS, settings, seconds).points
    assert point.time_from_start.to_sec() == pytest.approx(expected)


def test_a_trajectory_with_velocities():
    point, = sent(command_out_type=TRAJECTORY, publish_joint_velocities=True).points
    assert point.velocities == [0.5, -0.5] and point.positions == [0.1, 0.2]


def test_for_gazebo_the_point_is_repeated():
    points = sent(command_out_type=TRAJECTORY, use_gazebo=True, publish_joint_velocities=True).points
    assert len(points) == 30 and points[29].positions == points[0].positions
    assert points[29].time_from_start.to_sec() == pytest.approx(0.24)


def test_arrays_and_commands_of_baxter():
    assert sent(command_out_type=ARRAY).data == [0.1, 0.2]
    velocities = {"publish_joint_positions": False, "publish_joint_velocities": True}
    # What lags behind is caught up with.
    assert sent(command_out_type=ARRAY, **velocities).data == pytest.approx([0.5, -0.3])
    raw = sent(command_out_type=BAXTER)
    assert raw.mode == JointCommand.RAW_POSITION_MODE and raw.names == ["a", "b"] and raw.command == [0.1, 0.2]
    assert sent(command_out_type=BAXTER, **velocities).mode == JointCommand.VELOCITY_MODE


def test_a_type_whose_package_is_missing():
    with pytest.raises(SettingsError, match="the package of_nobody is not there"):
        message_type("of_nobody/Command")
