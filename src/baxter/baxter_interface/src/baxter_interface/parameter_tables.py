# SPDX-License-Identifier: BSD-3-Clause
"""The action servers' parameters: names, defaults, ranges. The *.cfg files make dynamic_reconfigure types of them.

Free of ROS and of the rest of the package: it is loaded while the workspace is being built.
"""
from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from baxter_model import ELECTRIC, SIDES, SUCTION, joint_names


class Parameter(NamedTuple):
    """A number with its meaning, default and range."""

    name: str
    meaning: str
    default: float
    lowest: float
    highest: float


def trajectory_parameters(goal_time: float, stopped_velocity: float, path: float, goal: float, highest: float,
                          gains: bool = False) -> Iterator[Parameter]:
    """Parameters of the trajectory server in one mode.

    goal_time [s], stopped_velocity [rad/s], path, goal [rad]: defaults; highest: of the tolerances' range;
    gains: whether the joints have kp, ki, kd.
    """
    yield Parameter("goal_time", "how much later than planned a goal may be reached [s]", goal_time, 0.0, 120.0)
    yield Parameter("stopped_velocity_tolerance", "velocity below which a joint has stopped at a goal [rad/s]; "
                    "0 or less: any", stopped_velocity, -1.0, 1.0)
    for joint in (name for side in SIDES for name in joint_names(side)):
        yield Parameter(joint + "_goal", "position error of %s allowed at a goal [rad]; 0 or less: any" % joint,
                        goal, -1.0, highest)
        yield Parameter(joint + "_trajectory", "position error of %s allowed on the way [rad]; 0 or less: any" % joint,
                        path, -1.0, highest)
        if gains:
            for gain, default, most, unit in (("kp", 2.0, 500.0, "1/s"), ("ki", 0.0, 100.0, "1/s^2"),
                                              ("kd", 0.0, 100.0, "1")):
                yield Parameter("%s_%s" % (joint, gain), "%s of %s, position error to velocity [%s]"
                                % (gain, joint, unit), default, 0.0, most)


POSITION = tuple(trajectory_parameters(0.1, 0.25, path=0.2, goal=-1.0, highest=1.0))
POSITION_FF = tuple(trajectory_parameters(0.1, 0.20, path=0.35, goal=-1.0, highest=1.0))
VELOCITY = tuple(trajectory_parameters(0.0, -1.0, path=-1.0, goal=-1.0, highest=3.0, gains=True))
GRIPPER = tuple(
    Parameter("%s_gripper_%s" % (side, name), meaning, default, lowest, highest)
    for side in SIDES
    for name, meaning, default, lowest, highest in (
        ("timeout", "longest time for a goal [s]; below 0: any", 5.0, -1.0, 20.0),
        ("goal", "position error at which a goal is reached [%]", ELECTRIC.parameters["dead_zone"], 0.0, 100.0),
        ("velocity", "speed of the fingers [%]", ELECTRIC.parameters["velocity"], 0.0, 100.0),
        ("moving_force", "force at which moving fingers grip, unless the goal says max_effort [%]",
         ELECTRIC.parameters["moving_force"], 0.0, 100.0),
        ("holding_force", "force of holding [%]", ELECTRIC.parameters["holding_force"], 0.0, 100.0),
        ("vacuum_threshold", "vacuum at which a cup holds, unless the goal says max_effort [%]",
         SUCTION.parameters["vacuum_sensor_threshold"], 0.0, 100.0),
        ("blow_off", "how long a release blows [s]", 0.0, 0.0, 100.0)))
HEAD = (
    Parameter("timeout", "longest time for a goal [s]; below 0: any", 5.0, -1.0, 20.0),
    Parameter("goal", "position error at which a goal is reached [rad]", 0.1396263401, 0.0, 1.57),
)


def generate(table: Iterable[Parameter], name: str) -> None:
    """Write the dynamic_reconfigure type `name` for a table of parameters, as a *.cfg file has to."""
    from dynamic_reconfigure.parameter_generator_catkin import ParameterGenerator, double_t

    generator = ParameterGenerator()
    for parameter in table:
        generator.add(parameter.name, double_t, 0, parameter.meaning, parameter.default, parameter.lowest,
                      parameter.highest)
    generator.generate("baxter_interface", "baxter_interface", name)
