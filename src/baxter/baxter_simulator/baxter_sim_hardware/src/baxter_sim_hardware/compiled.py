# SPDX-License-Identifier: BSD-3-Clause
"""The compiled functions of a tick: read from the cache, or compiled, before the first tick needs them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from baxter_sim_hardware.arms import avoidance
from baxter_sim_hardware.arms.actuators import ActuatorCommands, Actuators
from baxter_sim_hardware.arms.joint_command import ArmLimits, CommandParser, Mode
from baxter_sim_hardware.arms.joint_sensors import JointSensors
from baxter_sim_hardware.arms.raw_stream import RawStream
from baxter_sim_hardware.arms.safety import blocks_of
from baxter_sim_hardware.arms.setpoint import (
    SetPoints,
    Speeds,
    any_beyond,
    approach,
    approach_rates,
    cruising_speeds,
    follow,
    shares_in_step,
)

if TYPE_CHECKING:
    from collections.abc import Mapping


def load() -> None:
    """Those of every robot. In a new process this takes a second: numba prepares itself with the first of them."""
    here, at_rest, bound = np.zeros(1), np.zeros(1), np.ones(1)
    approach(here, at_rest, here, bound, bound, 1.0)
    points = SetPoints(1)
    follow(points.numbers, points.flags, np.zeros((1, 1)), 0, here, 1.0, 1.0)
    any_beyond(1.0, here, at_rest, here, 1.0)
    approach_rates(np.zeros(1, dtype=int), here, here, bound, bound, bound > 0.0)
    avoidance.field(avoidance.Guards(("guard",), np.zeros((1, 3)), bound), *_arm())
    limits = ArmLimits(("left_s0",), -bound, bound, bound, bound)
    parser = CommandParser(limits, limits.names)
    for mode in Mode:
        command = parser.parse(mode, limits.names, [0.0])
    speeds = Speeds(bound, 1.0, bound)
    RawStream(limits, bound, 1.0).take(points, np.zeros(1, dtype=int), command, 0.0)
    shares_in_step(command.index, command.values, points.position, speeds.numbers, 1.0)
    cruising_speeds(speeds.numbers, np.zeros(1, dtype=int), points.braking, here, points.speed)


def load_of_effects(numbers: Mapping[str, Mapping[str, Mapping[str, float]]]) -> None:
    """Those of a robot with every effect of the physical one; numbers: what ``effects.read`` returns."""
    here, at_rest, bound = np.zeros(1), np.zeros(1), np.ones(1)
    # Two joints: numbers of some of them are in another order in memory than those of all, or of one.
    sensors = JointSensors(numbers["noise"], ["left_s0", "left_s1"], 0, 0)
    sensors.reached(sensors.felt(np.zeros(2)), np.arange(2))
    actuators = Actuators(numbers["lag"], ["left_s0"])
    actuators.torques(ActuatorCommands(bound > 0.0, here, at_rest, bound > 0.0, here, bound), np.ones((3, 1)), 1.0)
    rotations, origins, rates = _arm()
    frames = rotations, origins
    avoidance.between(frames, frames, rates, 1.0, 1.0)
    avoidance.around(blocks_of(numbers["body"]), frames, rates, 1.0, 1.0)


def _arm() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(rotations, origins, rates) of an arm whose frames all coincide."""
    return np.zeros((8, 3, 3)), np.zeros((8, 3)), np.zeros(7)
