# SPDX-License-Identifier: BSD-3-Clause
"""Set-points as the messages of controllers."""
import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from baxter_core_msgs.msg import JointCommand

from joint_trajectory.action_edge import command_of
from joint_trajectory.follower import Follower
from moveit_servo.outputs import message_of, message_type
from moveit_servo.servo import ServoCommand, ServoStep, Status
from moveit_servo.settings import ARRAY, BAXTER, TRAJECTORY, ServoSettings, SettingsError

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import Driven, probot_model  # noqa: E402

CONFIG = Path(__file__).resolve().parents[2] / "config"
SPEED, BEGUN_RAD = 0.25, 1e-4
JOINTS = ("a", "b")
STEP = ServoStep(np.array((0.1, 0.2)), np.array((0.5, -0.5)), np.zeros(2), Status.NO_WARNING, "", False, False)
MEASURED = np.array((0.1, 0.1))


def probot():
    text = (CONFIG / "probot.yaml").read_text().replace("$(arg command_in_type)", "unitless")
    return ServoSettings.from_mapping(yaml.safe_load(text))


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
        step = ServoStep(np.array([position]), np.array([SPEED]), np.zeros(1), Status.NO_WARNING, "", False, False)
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
    settings = probot()
    speeds = speeds_of_a_controller(settings)
    assert 0.8 * SPEED < min(speeds) and max(speeds) < 1.2 * SPEED
    assert max(speeds_of_a_controller(dataclasses.replace(settings, command_lead=0.0))) > 3.0 * SPEED


@pytest.mark.parametrize("moving", [0.0, 0.008, 0.05, 0.2, 1.0])
def test_a_lead_grows_from_rest(moving):
    settings = ServoSettings(command_out_type=TRAJECTORY, command_lead=0.04, publish_joint_velocities=True)
    point, = message_of(STEP._replace(moving=moving), MEASURED, JOINTS, settings, 0.008, now=7.5).points
    due = 0.008 + 0.25 * moving
    assert point.time_from_start.to_sec() == pytest.approx(min(due, 0.04), abs=1e-6)
    assert point.velocities == pytest.approx([0.4, -0.4] if due < 0.04 else [0.5, -0.5])


def motion_from_rest(settings, with_lead):
    """(positions [rad], speeds [rad/s]) that a trajectory controller of 1 kHz commands, one a millisecond, while the
    first joint is steered from rest."""
    driven = Driven(probot_model(), "manipulator", {}, command_out_type=TRAJECTORY,
                    max_acceleration=settings.max_acceleration)
    follower, still, commanded = Follower(driven.servo.joints), np.zeros(6), []
    follower.start(0.0, still, still)
    for number, step in enumerate(driven.go(ServoCommand(joints=np.array([SPEED, *5 * [0.0]])), 0.4)):
        made = number * settings.publish_period
        step = step if with_lead else step._replace(moving=np.inf)
        message = message_of(step, step.position, driven.servo.joints, settings, settings.publish_period, made)
        follower.accept(command_of(message), made, still)
        for now in made + 0.001 * np.arange(1, 9):
            follower.update(now, still, still)
            commanded.append((follower.desired[0][0], follower.desired[1][0]))
    return np.array(commanded).T


def test_an_arm_moves_at_once_and_evenly_from_rest():
    positions, speeds = motion_from_rest(probot(), True)
    later, _ = motion_from_rest(probot(), False)
    assert np.argmax(positions > BEGUN_RAD) < 20 <= np.argmax(later > BEGUN_RAD)
    assert speeds.max() < 1.05 * SPEED and np.diff(speeds).max() < 0.025


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
