# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of MoveIt Servo, checked; and a few of ours. Free of ROS."""
from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

TRAJECTORY, ARRAY = "trajectory_msgs/JointTrajectory", "std_msgs/Float64MultiArray"
BAXTER = "baxter_core_msgs/JointCommand"
UNITLESS, SPEED_UNITS = "unitless", "speed_units"
THRESHOLD_DISTANCE, STOP_DISTANCE = "threshold_distance", "stop_distance"

_RENAMED = {"linear_scale": "scale/linear", "rotational_scale": "scale/rotational", "joint_scale": "scale/joint"}
_CHOICES = {"command_in_type": (UNITLESS, SPEED_UNITS), "command_out_type": (TRAJECTORY, ARRAY, BAXTER),
            "collision_check_type": (THRESHOLD_DISTANCE, STOP_DISTANCE)}
_OLD_NAMES = {"warning_topic": ("status_topic",), "collision_proximity_threshold": (
    "self_collision_proximity_threshold", "scene_collision_proximity_threshold")}
# Read at the start alone: connections and the group's tables are made by them.
_AT_START = ("move_group_name", "command_out_type", "command_out_topic", "cartesian_command_in_topic",
             "joint_command_in_topic", "joint_topic", "status_topic", "mesh_cuts")
# Least and greatest value with which an arm can be steered. A period of 0.1 s is as long as a command counts: with a
# longer one the arm would lurch. What is beyond those of the others leaves an arm at rest, or away from its target.
_RANGES = {
    "publish_period": (0.0005, 0.1), "stopping_time": (0.01, 10.0), "collision_check_rate": (1e-3, math.inf),
    **dict.fromkeys((
        "num_outgoing_halt_msgs_to_publish", "lower_singularity_threshold", "hard_stop_singularity_threshold",
        "joint_limit_margin", "low_pass_filter_coeff", "self_collision_proximity_threshold",
        "incoming_command_timeout", "scene_collision_proximity_threshold", "target_pose_timeout",
        "min_allowable_collision_distance", "windup_limit"), (0.0, math.inf)), "command_lead": (0.0, 10.0),
    **dict.fromkeys(("linear_scale", "rotational_scale", "joint_scale"), (-1e3, 1e3)),
    **dict.fromkeys(("%s_%s_gain" % (axis, kind) for axis in ("x", "y", "z", "angular")
                     for kind in ("proportional", "integral", "derivative")), (0.0, 1e3))}
_ACCELERATIONS = (0.01, 1e5)


class SettingsError(ValueError):
    """Parameters that cannot be used; the text names each, with its value and what would be right."""


@dataclass(frozen=True)
class ServoSettings:
    """Names and meanings are those of MoveIt Servo's YAML files; values that a file leaves out are those of its
    examples. Lengths in m, angles in rad, times in s, rates in Hz. Of the names, an empty one is chosen by the robot.

    Ours: max_acceleration, a number or {joint: number} [rad/s^2], None: what the velocity limits need to stop;
    stopping_time; command_lead: how long after its step a trajectory's point is due, by the time in its header, 0: a
    period after it has come, as MoveIt's; target_pose_timeout: how long a pose is pursued, 0: until it is reached;
    mesh_cuts: name of a dictionary in a module, as in ``convex_parts``, for links that are convex in a simulator; the
    PID gains of pose tracking, which in MoveIt are in a file for themselves.
    """

    move_group_name: str = ""
    planning_frame: str = ""
    ee_frame_name: str = ""
    robot_link_command_frame: str = ""
    command_in_type: str = SPEED_UNITS
    command_out_type: str = TRAJECTORY
    command_out_topic: str = ""
    cartesian_command_in_topic: str = "delta_twist_cmds"
    joint_command_in_topic: str = "delta_joint_cmds"
    joint_topic: str = "joint_states"
    status_topic: str = "status"
    linear_scale: float = 0.6
    rotational_scale: float = 0.3
    joint_scale: float = 0.01
    low_pass_filter_coeff: float = 2.0
    publish_period: float = 0.008
    low_latency_mode: bool = False
    use_gazebo: bool = False
    publish_joint_positions: bool = True
    publish_joint_velocities: bool = False
    publish_joint_accelerations: bool = False
    incoming_command_timeout: float = 0.1
    num_outgoing_halt_msgs_to_publish: int = 4
    lower_singularity_threshold: float = 30.0
    hard_stop_singularity_threshold: float = 120.0
    joint_limit_margin: float = 0.1
    check_collisions: bool = True
    collision_check_type: str = THRESHOLD_DISTANCE
    collision_check_rate: float = 50.0
    self_collision_proximity_threshold: float = 0.01
    scene_collision_proximity_threshold: float = 0.05
    collision_distance_safety_factor: float = 1000.0
    min_allowable_collision_distance: float = 0.01
    windup_limit: float = 0.05
    x_proportional_gain: float = 3.0
    y_proportional_gain: float = 3.0
    z_proportional_gain: float = 3.0
    x_integral_gain: float = 0.0
    y_integral_gain: float = 0.0
    z_integral_gain: float = 0.0
    x_derivative_gain: float = 0.0
    y_derivative_gain: float = 0.0
    z_derivative_gain: float = 0.0
    angular_proportional_gain: float = 3.0
    angular_integral_gain: float = 0.0
    angular_derivative_gain: float = 0.0
    target_pose_timeout: float = 0.5
    stopping_time: float = 0.1
    command_lead: float = 0.0
    max_acceleration: Any = None
    mesh_cuts: str = ""
    unknown: tuple[str, ...] = field(default=())

    @classmethod
    def from_mapping(cls, values: dict) -> ServoSettings:
        """Return the settings of a node's parameters (as nested as in YAML). ``unknown`` gets the names that mean
        nothing here. Raises SettingsError."""
        values, wrong, found = dict(values), [], {}
        for old, names in _OLD_NAMES.items():
            if old in values:
                for name in names:
                    values.setdefault(name, values[old])
                values.pop(old)
        scale = values.pop("scale", {})
        if not isinstance(scale, dict):
            raise SettingsError("scale is %r; expected linear, rotational and joint below it" % (scale,))
        values.update({"scale/" + name: value for name, value in scale.items()})
        known = {one.name: one for one in fields(cls) if one.name != "unknown"}
        for name, one in known.items():
            said = _RENAMED.get(name, name)
            if said in values:
                try:
                    found[name] = _converted(said, values.pop(said), one)
                except SettingsError as error:
                    wrong.append(str(error))
        settings = cls(**found, unknown=tuple(sorted(values)))
        wrong += settings._contradictions()
        if wrong:
            raise SettingsError("; ".join(wrong))
        return settings

    def _contradictions(self) -> list[str]:
        wrong = ["%s is %r; expected %s" % (name, getattr(self, name), " or ".join(map(repr, choices)))
                 for name, choices in _CHOICES.items() if getattr(self, name) not in choices]
        wrong += ["%s is %g; expected %s" % (name, getattr(self, name), _range(least, most))
                  for name, (least, most) in _RANGES.items() if not least <= getattr(self, name) <= most]
        if self.hard_stop_singularity_threshold < self.lower_singularity_threshold:
            wrong.append("hard_stop_singularity_threshold is %g, below lower_singularity_threshold, %g" % (
                self.hard_stop_singularity_threshold, self.lower_singularity_threshold))
        if not (self.publish_joint_positions or self.publish_joint_velocities or self.publish_joint_accelerations):
            wrong.append("nothing would be published: set publish_joint_positions or publish_joint_velocities to true")
        if self.command_out_type == ARRAY and self.publish_joint_positions and self.publish_joint_velocities:
            wrong.append("a %s holds positions or velocities, and both publish_joint_positions and "
                         "publish_joint_velocities are true" % ARRAY)
        if not self.command_out_topic:
            wrong.append("command_out_topic is missing; give it the topic of the arm's controller")
        return wrong


def at_run_time(settings: ServoSettings, begun_with: ServoSettings) -> tuple[ServoSettings, list[str]]:
    """Return what of new ``settings`` can be taken over by a servo that has ``begun_with`` others, and for each other
    change a text, "name 'value'"."""
    later = [name for name in _AT_START if getattr(settings, name) != getattr(begun_with, name)]
    return (replace(settings, **{name: getattr(begun_with, name) for name in later}),
            ["%s '%s'" % (name, getattr(settings, name)) for name in later])


def _range(least: float, most: float) -> str:
    return "%g or more" % least if math.isinf(most) else "%g to %g" % (least, most)


def _converted(name: str, value: Any, one: Any) -> Any:
    kind = one.type
    if kind == "Any":
        numbers = value.values() if isinstance(value, dict) else [] if value is None else [value]
        least, most = _ACCELERATIONS
        if not all(_is_number(number) and least <= number <= most for number in numbers):
            raise SettingsError("%s is %r; expected a number, %s, or one of each joint"
                                % (name, value, _range(least, most)))
        return value
    if kind == "bool" and isinstance(value, bool) or kind == "str" and isinstance(value, str):
        return value
    if kind == "float" and _is_number(value):
        return float(value)
    if kind == "int" and _is_number(value) and value == int(value):
        return int(value)
    words = {"bool": "true or false", "str": "a name", "float": "a number", "int": "a whole number"}
    raise SettingsError("%s is %r; expected %s" % (name, value, words[kind]))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
