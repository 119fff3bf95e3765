# SPDX-License-Identifier: BSD-3-Clause
"""MoveIt Servo's parameters, and the commands that come: which are in force, which are refused and why."""
import re

import numpy as np
import pytest

from moveit_servo.commands import CommandIgnored, Commands, sent_at
from moveit_servo.settings import ServoSettings, SettingsError

#: As in a file for MoveIt Servo: all parameters that its node asks for.
MOVEIT = {
    "use_gazebo": True, "command_in_type": "unitless", "scale": {"linear": 0.6, "rotational": 0.3, "joint": 0.01},
    "low_pass_filter_coeff": 2.0, "publish_period": 0.01, "low_latency_mode": True,
    "command_out_type": "std_msgs/Float64MultiArray", "publish_joint_positions": True,
    "publish_joint_velocities": False, "publish_joint_accelerations": False, "move_group_name": "manipulator",
    "planning_frame": "world", "ee_frame_name": "ee_link", "robot_link_command_frame": "world",
    "incoming_command_timeout": 1, "num_outgoing_halt_msgs_to_publish": 0, "lower_singularity_threshold": 17,
    "hard_stop_singularity_threshold": 30, "joint_limit_margin": 0, "cartesian_command_in_topic": "twists",
    "joint_command_in_topic": "jogs", "joint_topic": "joint_states", "status_topic": "status",
    "command_out_topic": "/joint_group_position_controller/command", "check_collisions": True,
    "collision_check_rate": 50,
    "collision_check_type": "stop_distance", "self_collision_proximity_threshold": 0.01,
    "scene_collision_proximity_threshold": 0.05, "collision_distance_safety_factor": 1000,
    "min_allowable_collision_distance": 0.01, "windup_limit": 0.05, "x_proportional_gain": 1.5,
    "angular_proportional_gain": 0.5}


def test_a_file_for_moveit_servo_is_taken_as_it_is():
    settings = ServoSettings.from_mapping(MOVEIT)
    assert (settings.linear_scale, settings.rotational_scale, settings.joint_scale) == (0.6, 0.3, 0.01)
    assert settings.incoming_command_timeout == 1.0 and settings.low_latency_mode and not settings.unknown
    assert settings.cartesian_command_in_topic == "twists"


def test_old_names_and_unknown_ones():
    values = {name: value for name, value in MOVEIT.items() if "proximity" not in name and name != "status_topic"}
    values |= {"collision_proximity_threshold": 0.03, "warning_topic": "w", "foo": 1}
    settings = ServoSettings.from_mapping(values)
    assert settings.self_collision_proximity_threshold == settings.scene_collision_proximity_threshold == 0.03
    assert settings.status_topic == "w" and settings.unknown == ("foo",)


@pytest.mark.parametrize(("name", "value"), [
    ("publish_period", 0), ("publish_period", "fast"), ("num_outgoing_halt_msgs_to_publish", -1),
    ("num_outgoing_halt_msgs_to_publish", 1.5), ("lower_singularity_threshold", 99), ("joint_limit_margin", -0.1),
    ("command_in_type", "speed"), ("command_out_type", "std_msgs/Float64"), ("publish_joint_velocities", True),
    ("publish_joint_positions", False), ("collision_check_type", "none"), ("use_gazebo", "yes"),
    ("self_collision_proximity_threshold", -1), ("command_out_topic", ""), ("max_acceleration", {"joint_1": -2}),
    ("stopping_time", float("nan")), ("scale", 3), ("publish_period", 1e-9), ("publish_period", 30),
    ("stopping_time", 1e-9), ("stopping_time", 60), ("max_acceleration", 1e-300), ("x_proportional_gain", -5),
    ("angular_integral_gain", -1), ("z_derivative_gain", 1e308), ("command_lead", 1e308)])
def test_what_cannot_be_used_is_named_with_its_value(name, value):
    with pytest.raises(SettingsError) as caught:
        ServoSettings.from_mapping({**MOVEIT, name: value})
    assert name in str(caught.value)
    if not isinstance(value, (bool, dict)):
        assert re.escape(str(value)) in re.escape(str(caught.value))


def test_all_that_is_wrong_is_told_at_once():
    with pytest.raises(SettingsError, match="publish_period.*joint_limit_margin"):
        ServoSettings.from_mapping({**MOVEIT, "publish_period": -1, "joint_limit_margin": -1})


# -- commands ----------------------------------------------------------------------------------------------------

UNITLESS = ServoSettings.from_mapping({**MOVEIT, "incoming_command_timeout": 0.1})
SPEEDS = ServoSettings.from_mapping({**MOVEIT, "command_in_type": "speed_units", "incoming_command_timeout": 0.1})


def commands():
    return Commands(("a", "b"))


def test_units_scale_and_control_dimensions():
    taken = commands()
    taken.take_twist((1, 0, 0, 0, 0, -0.5), "hand", 5.0, UNITLESS)
    kind, value, frame = taken.newest(5.05, UNITLESS)
    assert (kind, frame) == ("twist", "hand") and value == pytest.approx([0.6, 0, 0, 0, 0, -0.15])
    taken.control = np.array([0, 1, 1, 1, 1, 1], dtype=bool)
    taken.take_twist((3, 2, 0, 0, 0, 0), "", 6.0, SPEEDS)
    assert taken.newest(6.0, SPEEDS)[1] == pytest.approx([0, 2, 0, 0, 0, 0])
    taken.take_jog(["b"], [1.0], 7.0, UNITLESS)
    assert taken.newest(7.0, UNITLESS)[1] == pytest.approx([0.0, 0.01])


def test_commands_grow_old_and_twists_go_first():
    taken = commands()
    taken.take_pose(np.eye(4), 1.0)
    assert taken.newest(1.2, SPEEDS)[0] == "pose"
    taken.take_jog(["a"], [0.5], 1.2, SPEEDS)
    taken.take_twist((0.1, 0, 0, 0, 0, 0), "", 1.2, SPEEDS)
    assert taken.newest(1.25, SPEEDS)[0] == "twist"
    taken.take_twist((0,) * 6, "", 1.25, SPEEDS)
    assert taken.newest(1.25, SPEEDS)[0] == "joints"
    assert taken.newest(1.31, SPEEDS)[0] == ""  # the pose has been given up
    taken.take_pose(np.eye(4), 2.0)
    assert taken.newest(2.0, SPEEDS)[0] == "pose"
    assert taken.newest(2.0 + SPEEDS.target_pose_timeout, SPEEDS)[0] == ""


def test_a_command_counts_for_one_step_also_where_time_jumps():
    taken = commands()
    taken.take_twist((0.1, 0, 0, 0, 0, 0), "", 1.0, SPEEDS)
    taken.take_jog(["a"], [0.5], 1.0, SPEEDS)
    assert [taken.newest(1.0 + 3.0 * SPEEDS.incoming_command_timeout, SPEEDS)[0] for _ in range(2)] == ["twist", ""]
    taken.take_twist((0.1, 0, 0, 0, 0, 0), "", -np.inf, SPEEDS)
    assert taken.newest(2.0, SPEEDS)[0] == "", "it has come too late"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1.01])
def test_a_bad_twist_ends_the_one_before(value):
    values = (value, 0, 0, 0, 0, 0)
    taken = commands()
    taken.take_twist((0.5, 0, 0, 0, 0, 0), "", 1.0, UNITLESS)
    with pytest.raises(CommandIgnored, match=re.escape(str(values[0]))):
        taken.take_twist(values, "", 1.01, UNITLESS)
    assert taken.newest(1.02, UNITLESS)[0] == ""


def test_joint_commands_with_other_names_or_none():
    taken = commands()
    assert "name c;" in taken.take_jog(["a", "c"], [0.2, 0.3], 1.0, SPEEDS)
    assert taken.newest(1.0, SPEEDS)[1] == pytest.approx([0.2, 0.0])
    assert "name '';" in taken.take_jog([""], [0.3], 1.0, SPEEDS)
    assert "0 names but 1 velocity;" in taken.take_jog([], [0.1], 1.1, SPEEDS)  # MoveIt's own test sends this
    assert taken.newest(1.1, SPEEDS)[1] == pytest.approx([0.0, 0.0])
    assert "1 name but 2 velocities;" in taken.take_jog(["b"], [0.1, 0.2], 1.1, SPEEDS)
    assert taken.newest(1.1, SPEEDS)[1] == pytest.approx([0.0, 0.1])
    assert taken.take_jog(["b"], [0.1], 1.1, SPEEDS) == ""
    with pytest.raises(CommandIgnored, match="2 names but 1 velocity$"):
        taken.take_jog(["a", "b"], [0.2], 1.2, SPEEDS)


def test_a_stamp_in_the_future_does_not_keep_an_arm_moving():
    assert sent_at(100.0, 5.0) == 5.0 and sent_at(0.0, 5.0) == 5.0 and sent_at(4.9, 5.0) == 4.9
