# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory server on the actuators of a physical robot, in lock-step: when is the path's tolerance left?"""
import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
import rospkg
from baxter_core_msgs.msg import JointCommand
from trajectory_msgs.msg import JointTrajectoryPoint

import xacro
from baxter_interface import parameter_tables
from baxter_model import joint_names
from joint_trajectory import GoalOutcome, TrajectoryCommand
from joint_trajectory_action.arm_motion import ArmMotion, CommandMode, GoalDefaults
from urdf_model import parse_urdf

HARDWARE = Path(rospkg.RosPack().get_path("baxter_sim_hardware"))
NAMES = list(joint_names("left"))
START = np.tile([0.0, -0.1, 0.0, 0.6, 0.0, 0.6, 0.0], 2)
TABLES = {CommandMode.POSITION: parameter_tables.POSITION,
          CommandMode.POSITION_WITH_DYNAMICS: parameter_tables.POSITION_FF}
PERIOD_S = 0.01


@pytest.fixture(scope="module")
def robot():
    path = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    return parse_urdf(xacro.process_file(path).toxml(), source=path)


@pytest.fixture()
def lab(robot):
    spec = importlib.util.spec_from_file_location("hardware_lab", HARDWARE / "test" / "unit" / "conftest.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.Lab(robot, parameters={"enable": True, "effects": "lag"}, angles=START)
    yield made
    made.close()


def follow(lab, mode, fastest, way=-0.9):
    """Move s1 of the left arm, at most at `fastest` [rad/s]; returns the Verdict of the trajectory server's core."""
    motion = ArmMotion(NAMES, mode, PERIOD_S)
    settings = GoalDefaults.from_config({each.name: each.default for each in TABLES[mode]}, NAMES)
    duration = abs(way) * math.pi / (2.0 * fastest)
    times = np.linspace(0.0, duration, 12)[1:]
    points = []
    for time in times:
        position, velocity = START[:7].copy(), np.zeros(7)
        position[1] += 0.5 * way * (1.0 - math.cos(math.pi * time / duration))
        velocity[1] = 0.5 * way * math.pi / duration * math.sin(math.pi * time / duration)
        points.append((float(time), position.tolist(), velocity.tolist(), []))
    lab.run(0.2)
    begin = lab.world.time_s
    motion.begin(TrajectoryCommand(NAMES, points, None), 0.0, lab.position[:7], "goal", settings)
    raw = mode is CommandMode.POSITION_WITH_DYNAMICS
    while motion.goal is not None:
        now = lab.world.time_s - begin
        assert now < duration + 3.0
        verdict = motion.tick(now, lab.position[:7], lab.velocity[:7])
        if raw:
            position, velocity, acceleration = motion.output.tolist()
            lab.send("limb/left/inverse_dynamics_command", JointTrajectoryPoint(
                positions=position, velocities=velocity, accelerations=acceleration))
        lab.command(JointCommand.RAW_POSITION_MODE if raw else JointCommand.POSITION_MODE,
                    list(motion.command().values()), NAMES)
        lab.run(PERIOD_S)
    return verdict


def test_position_mode_aborts_a_fast_shoulder(lab):
    """By the 0.2 rad that the vendor's server allows, as users of physical robots complain."""
    verdict = follow(lab, CommandMode.POSITION, 1.1)
    assert verdict.outcome is GoalOutcome.PATH_TOLERANCE_VIOLATED and "left_s1" in verdict.text


@pytest.mark.parametrize("mode, fastest", [(CommandMode.POSITION, 0.35), (CommandMode.POSITION_WITH_DYNAMICS, 1.1)])
def test_a_slow_shoulder_and_one_whose_velocities_are_fed_forward_arrive(lab, mode, fastest):
    verdict = follow(lab, mode, fastest)
    assert verdict.outcome is GoalOutcome.SUCCEEDED, verdict.text
    assert abs(lab.position[1] - (START[1] - 0.9)) < 0.25
