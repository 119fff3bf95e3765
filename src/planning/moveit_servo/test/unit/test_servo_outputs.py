# SPDX-License-Identifier: BSD-3-Clause
"""Set-points as the messages of controllers."""
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml
from baxter_core_msgs.msg import JointCommand

from joint_trajectory.action_edge import command_of
from joint_trajectory.follower import Follower
from moveit_servo.outputs import message_of, message_type
from moveit_servo.servo import Status, Step
from moveit_servo.settings import ARRAY, BAXTER, TRAJECTORY, ServoSettings, SettingsError

CONFIG = Path(__file__).resolve().parents[2] / "config"
SPEED = 0.25
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


@pytest.mark.parametrize("seconds", [0.002, 0.03])
def test_with_a_lead_a_trajectory_is_due_at_a_time(seconds):
    settings = ServoSettings(command_out_type=TRAJECTORY, command_lead=0.024)
    message = message_of(STEP, MEASURED, JOINTS, settings, seconds, now=7.5)
    assert message.header.stamp.to_sec() == 7.5
    assert message.points[0].time_from_start.to_sec() == pytest.approx(0.024)


def speeds_of_a_controller(settings):
    """Speeds [rad/s] that a trajectory controller of 1 kHz commands in a steady stream of SPEED. One step in twenty
    takes three periods, and messages take up to some milliseconds, as on a busy machine."""
    chance, coming, position, made, comes = np.random.default_rng(1), [], 0.0, 0.0, 0.0
    while made < 2.0:
        seconds = settings.publish_period * (1.0 if chance.random() < 0.95 else 3.0)
        made, position = made + seconds, position + SPEED * seconds
        step = Step(np.array([position]), np.array([SPEED]), np.zeros(1), Status.NO_WARNING, "", False, False)
        comes = max(comes, made + chance.exponential(0.001))
        coming.append((comes, message_of(step, step.position, ("a",), settings, seconds, made)))
    follower, speeds = Follower(["a"]), []
    follower.start(0.0, [0.0], [0.0])
    for now in np.arange(0.0, 1.9, 0.001):
        while coming[0][0] <= now:
            follower.accept(command_of(coming.pop(0)[1]), now, [0.0])
        follower.update(now, [0.0], [0.0])
        speeds.append(follower.desired[1][0])
    return speeds[200:]


def test_a_busy_machine_makes_no_peaks_of_speed_at_the_trajectory_controller_of_probot():
    text = (CONFIG / "probot.yaml").read_text().replace("$(arg command_in_type)", "unitless")
    settings = ServoSettings.from_mapping(yaml.safe_load(text))
    speeds = speeds_of_a_controller(settings)
    assert 0.8 * SPEED < min(speeds) and max(speeds) < 1.2 * SPEED
    assert max(speeds_of_a_controller(dataclasses.replace(settings, command_lead=0.0))) > 3.0 * SPEED


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
